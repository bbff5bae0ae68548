// Renders tile by tile, so that rays share cached voxels.
#include "kernels/field/cpu/render_view.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "kernels/field/cpu/rays.h"

namespace regrade {
namespace {

// `render_row(rays, count, first)` renders the rays of a part of a row, which begins at pixel
// `first`. Returns all rays.
template <typename RenderRow>
std::vector<Ray> RenderTiles(const Camera& camera, const RenderRow& render_row) {
  constexpr int kTile = 16;
  const int width = camera.width, height = camera.height;
  const int tiles_x = (width + kTile - 1) / kTile, tiles_y = (height + kTile - 1) / kTile;
  std::vector<Ray> rays(static_cast<size_t>(width) * height);
#pragma omp parallel for schedule(dynamic, 1)
  for (int tile = 0; tile < tiles_x * tiles_y; ++tile) {
    const int x0 = tile % tiles_x * kTile, y0 = tile / tiles_x * kTile;
    const int x1 = std::min(x0 + kTile, width), y1 = std::min(y0 + kTile, height);
    for (int y = y0; y < y1; ++y) {
      const size_t first = static_cast<size_t>(y) * width + x0;
      for (int x = x0; x < x1; ++x) rays[first + x - x0] = camera.PixelRay(x, y);
      render_row(&rays[first], x1 - x0, first);
    }
  }
  return rays;
}

RenderedView EmptyView(const Camera& camera) {
  const int width = camera.width, height = camera.height;
  return {Image(width, height, 3), Image(width, height, 1), Image(width, height, 1)};
}

}  // namespace

RenderedView RenderView(const FastGrid& grid, const Camera& camera,
                        const MarchOptions& options) {
  RenderedView view = EmptyView(camera);
  const std::vector<Ray> rays =
      RenderTiles(camera, [&](const Ray* row, int64_t n, size_t first) {
        FastRays().render(grid, row, n, options, &view.color.pixels[3 * first],
                          &view.depth.pixels[first], &view.transmittance.pixels[first]);
      });
  FinishView(camera, rays, &view);
  return view;
}

RenderedPair RenderViewPair(const FastGrid& grid, const FastGrid& other, const Camera& camera,
                            const MarchOptions& options) {
  RenderedPair pair{EmptyView(camera), Image(camera.width, camera.height, 3)};
  RenderedView& view = pair.view;
  const std::vector<Ray> rays =
      RenderTiles(camera, [&](const Ray* row, int64_t n, size_t first) {
        FastRays().render_pair(grid, other, row, n, options, &view.color.pixels[3 * first],
                               &pair.other_color.pixels[3 * first], &view.depth.pixels[first],
                               &view.transmittance.pixels[first]);
      });
  RenderedView of_other{std::move(pair.other_color), view.depth, view.transmittance};
  FinishView(camera, rays, &view);
  FinishView(camera, rays, &of_other);
  pair.other_color = std::move(of_other.color);
  return pair;
}

RenderedView RenderView(const RadianceField& field, const Camera& camera,
                        const MarchOptions& options) {
  return RenderView(MakeFastGrid(field), camera, options);
}

}  // namespace regrade
