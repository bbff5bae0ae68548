// Renders tile by tile, so that rays share cached voxels.
#include "kernels/field/cpu/render_view.h"

#include <algorithm>
#include <vector>

#include "kernels/field/cpu/rays.h"

namespace regrade {

RenderedView RenderView(const FastGrid& grid, const Camera& camera,
                        const MarchOptions& options) {
  constexpr int kTile = 16;
  const int width = camera.width, height = camera.height;
  const int tiles_x = (width + kTile - 1) / kTile, tiles_y = (height + kTile - 1) / kTile;
  RenderedView view{Image(width, height, 3), Image(width, height, 1), Image(width, height, 1)};
  std::vector<Ray> rays(static_cast<size_t>(width) * height);
#pragma omp parallel for schedule(dynamic, 1)
  for (int tile = 0; tile < tiles_x * tiles_y; ++tile) {
    const int x0 = tile % tiles_x * kTile, y0 = tile / tiles_x * kTile;
    const int x1 = std::min(x0 + kTile, width), y1 = std::min(y0 + kTile, height);
    for (int y = y0; y < y1; ++y) {
      const size_t first = static_cast<size_t>(y) * width + x0;
      for (int x = x0; x < x1; ++x) rays[first + x - x0] = camera.PixelRay(x, y);
      FastRays().render(grid, &rays[first], x1 - x0, options, &view.color.pixels[3 * first],
                        &view.depth.pixels[first], &view.transmittance.pixels[first]);
    }
  }
  FinishView(camera, rays, &view);
  return view;
}

RenderedView RenderView(const RadianceField& field, const Camera& camera,
                        const MarchOptions& options) {
  return RenderView(MakeFastGrid(field), camera, options);
}

}  // namespace regrade
