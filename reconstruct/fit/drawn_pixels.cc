#include "reconstruct/fit/drawn_pixels.h"

#include "kernels/base/vec.h"

namespace regrade {

std::vector<int32_t> DrawnPixels(const Image& photo) {
  std::vector<int32_t> drawn;
  for (int y = 0; y < photo.height; ++y)
    for (int x = 0; x < photo.width; ++x) {
      const int32_t pixel = y * photo.width + x;
      const float* const color = &photo.pixels[static_cast<size_t>(3 * int64_t{pixel})];
      if (AllFinite(Vec3f{color[0], color[1], color[2]})) drawn.push_back(pixel);
    }
  return drawn;
}

}  // namespace regrade
