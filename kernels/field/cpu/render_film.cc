#include "kernels/field/cpu/render_film.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <utility>
#include <vector>

#include "kernels/field/cpu/rays.h"

namespace regrade {
namespace {

constexpr int kFilmTile = 32;
constexpr int kBatch = 256;  // rays

struct Offset {
  int x, y;
};
// Four neighbours, in opposite pairs, and eight that are the square root of five times as far.
struct Neighbours {
  std::array<Offset, 4> near;
  std::array<Offset, 8> far;
  int reach;
};
constexpr Neighbours kDiagonal{
    {{{-1, -1}, {1, 1}, {-1, 1}, {1, -1}}},
    {{{-3, -1}, {-3, 1}, {3, -1}, {3, 1}, {-1, -3}, {1, -3}, {-1, 3}, {1, 3}}},
    3};
constexpr Neighbours kBeside{
    {{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}},
    {{{-2, -1}, {-2, 1}, {2, -1}, {2, 1}, {-1, -2}, {1, -2}, {-1, 2}, {1, 2}}},
    2};

class FilmFrameRenderer {
 public:
  FilmFrameRenderer(const FastGrid& grid, const FastGrid& other, const Camera& camera,
                    const MarchOptions& options, float tolerance)
      : grid_(grid),
        other_(other),
        camera_(camera),
        options_(options),
        tolerance_(tolerance),
        width_(camera.width),
        height_(camera.height),
        rays_(static_cast<size_t>(width_) * static_cast<size_t>(height_)) {
    RenderedView& view = frame_.pair.view;
    view = {Image(width_, height_, 3), Image(width_, height_, 1), Image(width_, height_, 1)};
    frame_.pair.other_color = Image(width_, height_, 3);
  }

  FilmFrame Render() {
    Pass([](int x, int y) { return x % 2 == 0 && y % 2 == 0; }, nullptr);
    Pass([](int x, int y) { return x % 2 == 1 && y % 2 == 1; }, &kDiagonal);
    Pass([](int x, int y) { return (x + y) % 2 == 1; }, &kBeside);
    RenderedPair& pair = frame_.pair;
    RenderedView of_other{std::move(pair.other_color), pair.view.depth,
                          pair.view.transmittance};
    FinishView(camera_, rays_, &pair.view);
    FinishView(camera_, rays_, &of_other);
    pair.other_color = std::move(of_other.color);
    frame_.rays = rendered_;
    return std::move(frame_);
  }

 private:
  // Pixels to render, and what comes out.
  struct Batch {
    size_t pixel[kBatch];
    Ray ray[kBatch];
    float color[3 * kBatch], other_color[3 * kBatch], depth[kBatch], transmittance[kBatch];
    int count = 0;
  };

  // All pixels of one of the three sets; their neighbours are known from the passes before.
  template <typename IsOfSet>
  void Pass(const IsOfSet& is_of_set, const Neighbours* neighbours) {
    const int tiles_x = (width_ + kFilmTile - 1) / kFilmTile,
              tiles_y = (height_ + kFilmTile - 1) / kFilmTile;
#pragma omp parallel for schedule(dynamic, 1)
    for (int tile = 0; tile < tiles_x * tiles_y; ++tile) {
      const int x0 = tile % tiles_x * kFilmTile, y0 = tile / tiles_x * kFilmTile;
      Batch batch;
      for (int y = y0; y < std::min(y0 + kFilmTile, height_); ++y)
        for (int x = x0; x < std::min(x0 + kFilmTile, width_); ++x) {
          if (!is_of_set(x, y)) continue;
          const size_t pixel =
              static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
          rays_[pixel] = camera_.PixelRay(x, y);
          if (neighbours != nullptr && IsInside(x, y, neighbours->reach) &&
              Interpolate(pixel, *neighbours))
            continue;
          batch.pixel[batch.count] = pixel;
          batch.ray[batch.count++] = rays_[pixel];
          if (batch.count == kBatch) RenderBatch(&batch);
        }
      RenderBatch(&batch);
    }
  }

  void RenderBatch(Batch* batch) {
    if (batch->count == 0) return;
    FastRays().render_pair(grid_, other_, batch->ray, batch->count, options_, batch->color,
                           batch->other_color, batch->depth, batch->transmittance);
    RenderedView& view = frame_.pair.view;
    for (int i = 0; i < batch->count; ++i) {
      const size_t to = batch->pixel[i];
      std::copy_n(batch->color + 3 * i, 3, &view.color.pixels[3 * to]);
      std::copy_n(batch->other_color + 3 * i, 3, &frame_.pair.other_color.pixels[3 * to]);
      view.depth.pixels[to] = batch->depth[i];
      view.transmittance.pixels[to] = batch->transmittance[i];
    }
    rendered_ += batch->count;
    batch->count = 0;
  }

  bool IsInside(int x, int y, int reach) const {
    return std::min(x, y) >= reach && x + reach < width_ && y + reach < height_;
  }

  bool Interpolate(size_t pixel, const Neighbours& neighbours) {
    const auto at = [&](const Offset& offset) {
      return static_cast<size_t>(static_cast<int64_t>(pixel) + offset.x +
                                 int64_t{offset.y} * width_);
    };
    RenderedView& view = frame_.pair.view;
    float result[6];
    for (size_t c = 0; c < 6; ++c) {
      const Image& image = c < 3 ? view.color : frame_.pair.other_color;
      const auto value = [&](const Offset& offset) {
        return std::clamp(image.pixels[3 * at(offset) + c % 3], 0.0f, 1.0f);
      };
      float near[4], far = 0;
      for (size_t k = 0; k < 4; ++k) near[k] = value(neighbours.near[k]);
      for (const Offset& offset : neighbours.far) far += value(offset) / 8;
      const float one = (near[0] + near[1]) / 2, other = (near[2] + near[3]) / 2;
      const auto [low, high] = std::minmax_element(near, near + 4);
      const float mean = (one + other) / 2;
      if (!(std::abs(one - other) <= tolerance_ && std::abs(mean - far) <= 3 * tolerance_ &&
            *high - *low <= 10 * tolerance_))
        return false;
      result[c] = mean + (mean - far) / 4;
    }
    std::copy_n(result, 3, &view.color.pixels[3 * pixel]);
    std::copy_n(result + 3, 3, &frame_.pair.other_color.pixels[3 * pixel]);
    view.depth.pixels[pixel] = view.depth.pixels[at(neighbours.near[0])];
    view.transmittance.pixels[pixel] = view.transmittance.pixels[at(neighbours.near[0])];
    return true;
  }

  const FastGrid &grid_, &other_;
  const Camera& camera_;
  const MarchOptions options_;
  const float tolerance_;
  const int width_, height_;
  std::vector<Ray> rays_;
  FilmFrame frame_;
  std::atomic<int64_t> rendered_ = 0;
};

}  // namespace

FilmFrame RenderFilmFrame(const FastGrid& grid, const FastGrid& other, const Camera& camera,
                          const MarchOptions& options, float tolerance) {
  return FilmFrameRenderer(grid, other, camera, options, tolerance).Render();
}

}  // namespace regrade
