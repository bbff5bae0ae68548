#include "reconstruct/fit/drawn_pixels.h"

#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

constexpr int kMargin = 8;  // pixels
constexpr float kSameColor = 0.5f / 255;

Vec3f ColorAt(const Image& photo, int64_t pixel) {
  const float* const color = &photo.pixels[static_cast<size_t>(3 * pixel)];
  return {color[0], color[1], color[2]};
}

// Counts of pixels that do not show the background, left of and above (x, y): [H + 1, W + 1].
std::vector<int32_t> CountsOfOthers(const Image& photo, const Vec3f& background) {
  const size_t width = static_cast<size_t>(photo.width), stride = width + 1;
  std::vector<int32_t> counts(stride * (static_cast<size_t>(photo.height) + 1));
  for (size_t y = 0; y < static_cast<size_t>(photo.height); ++y)
    for (size_t x = 0; x < width; ++x) {
      const Vec3f color = ColorAt(photo, static_cast<int64_t>(y * width + x));
      bool same = AllFinite(color);
      for (int c = 0; c < 3 && same; ++c)
        same = std::abs(color[c] - background[c]) < kSameColor;
      counts[(y + 1) * stride + x + 1] = counts[(y + 1) * stride + x] +
                                         counts[y * stride + x + 1] - counts[y * stride + x] +
                                         (same ? 0 : 1);
    }
  return counts;
}

}  // namespace

std::vector<int32_t> DrawnPixels(const Image& photo, const std::optional<Vec3f>& background) {
  const size_t stride = static_cast<size_t>(photo.width) + 1;
  const std::vector<int32_t> counts =
      background ? CountsOfOthers(photo, *background) : std::vector<int32_t>();
  const auto only_background_near = [&](int x, int y) {
    const size_t left = static_cast<size_t>(std::max(x - kMargin, 0)),
                 top = static_cast<size_t>(std::max(y - kMargin, 0)),
                 right = static_cast<size_t>(std::min(x + kMargin + 1, photo.width)),
                 bottom = static_cast<size_t>(std::min(y + kMargin + 1, photo.height));
    return counts[bottom * stride + right] - counts[bottom * stride + left] -
               counts[top * stride + right] + counts[top * stride + left] ==
           0;
  };
  std::vector<int32_t> drawn;
  for (int y = 0; y < photo.height; ++y)
    for (int x = 0; x < photo.width; ++x) {
      const int32_t pixel = y * photo.width + x;
      if (!AllFinite(ColorAt(photo, pixel))) continue;
      const bool kept = (x % 2) + (y % 2) == 0;  // one in four
      if (background && !kept && only_background_near(x, y)) continue;
      drawn.push_back(pixel);
    }
  return drawn;
}

}  // namespace regrade
