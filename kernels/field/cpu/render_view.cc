// Renders tile by tile, so that rays share cached voxels.
#include "kernels/field/cpu/render_view.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "kernels/field/cpu/rays.h"

namespace regrade {
namespace {

constexpr int kTile = 16;
constexpr int kMostRays = kTile * kTile;

// What is rendered of a tile's rays; `other_color` in a pair.
struct TileResult {
  float color[3 * kMostRays], other_color[3 * kMostRays];
  float depth[kMostRays], transmittance[kMostRays];
};

// `render(rays, count, &result)` renders the rays of a tile, in rows. Returns all rays.
template <typename Render>
std::vector<Ray> RenderTiles(const Camera& camera, const Render& render, RenderedView* view,
                             Image* other_color) {
  const int width = camera.width, height = camera.height;
  const int tiles_x = (width + kTile - 1) / kTile, tiles_y = (height + kTile - 1) / kTile;
  std::vector<Ray> rays(static_cast<size_t>(width) * height);
#pragma omp parallel for schedule(dynamic, 1)
  for (int tile = 0; tile < tiles_x * tiles_y; ++tile) {
    const int x0 = tile % tiles_x * kTile, y0 = tile / tiles_x * kTile;
    const int x1 = std::min(x0 + kTile, width), y1 = std::min(y0 + kTile, height);
    const int columns = x1 - x0;
    Ray own[kMostRays];
    int count = 0;
    for (int y = y0; y < y1; ++y)
      for (int x = x0; x < x1; ++x) own[count++] = camera.PixelRay(x, y);
    TileResult result;
    render(own, count, &result);
    for (int y = y0; y < y1; ++y) {
      const int from = (y - y0) * columns;
      const size_t to = static_cast<size_t>(y) * width + x0;
      std::copy_n(own + from, columns, &rays[to]);
      std::copy_n(result.color + 3 * from, 3 * columns, &view->color.pixels[3 * to]);
      std::copy_n(result.depth + from, columns, &view->depth.pixels[to]);
      std::copy_n(result.transmittance + from, columns, &view->transmittance.pixels[to]);
      if (other_color != nullptr)
        std::copy_n(result.other_color + 3 * from, 3 * columns, &other_color->pixels[3 * to]);
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
  const std::vector<Ray> rays = RenderTiles(
      camera,
      [&](const Ray* tile, int64_t n, TileResult* r) {
        FastRays().render(grid, tile, n, options, r->color, r->depth, r->transmittance);
      },
      &view, nullptr);
  FinishView(camera, rays, &view);
  return view;
}

RenderedPair RenderViewPair(const FastGrid& grid, const FastGrid& other, const Camera& camera,
                            const MarchOptions& options) {
  RenderedPair pair{EmptyView(camera), Image(camera.width, camera.height, 3)};
  RenderedView& view = pair.view;
  const std::vector<Ray> rays = RenderTiles(
      camera,
      [&](const Ray* tile, int64_t n, TileResult* r) {
        FastRays().render_pair(grid, other, tile, n, options, r->color, r->other_color,
                               r->depth, r->transmittance);
      },
      &view, &pair.other_color);
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
