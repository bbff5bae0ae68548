#include "pipeline/capture/mask_picture.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/images/image_file.h"

namespace regrade {
namespace {

constexpr float kGrey = 0.1f;       // colours of a pixel that differ by less are one grey
constexpr float kOne = 1.5f / 255;  // a value of 1, rounded

// Whether parts are transparent, and a hundredth of the rest or more has colours.
bool IsCutOut(const Image& mask) {
  if (mask.channels != 4) return false;
  int64_t seen = 0, colored = 0;
  for (int64_t i = 0; i < mask.num_pixels(); ++i) {
    const float* p = &mask.pixels[4 * i];
    if (p[3] < 0.5f) continue;
    ++seen;
    colored += std::max({p[0], p[1], p[2]}) - std::min({p[0], p[1], p[2]}) > kGrey;
  }
  return seen < mask.num_pixels() && 100 * colored >= seen && colored > 0;
}

// Black pictures may hold some noise; a thousandth of the pixels is a region.
void RefuseZeroAndOne(const Image& mask, const std::string& path) {
  const float largest = *std::ranges::max_element(mask.pixels);
  const auto regions =
      std::ranges::count_if(mask.pixels, [](float value) { return value > 0; });
  if (largest > 0 && largest < kOne && 1000 * regions >= mask.num_pixels())
    throw InputError(Format("its largest value is %.3g of 255", 255 * largest), path,
                     "write 255 for white");
}

}  // namespace

Vec3f MaskColor(const Image& mask, int64_t pixel) {
  const float* p = &mask.pixels[pixel * mask.channels];
  const float alpha = mask.channels == 4 ? p[3] : 1;
  const bool grey = mask.channels < 3;
  return Vec3f{p[0], p[grey ? 0 : 1], p[grey ? 0 : 2]} * alpha;
}

Image ReadMask(const std::string& path) {
  const Image picture = ReadGivenImage(path);
  const bool cut_out = IsCutOut(picture);
  Image mask(picture.width, picture.height, 1);
  for (int64_t i = 0; i < mask.num_pixels(); ++i) {
    const Vec3f color = MaskColor(picture, i);
    mask.pixels[i] = cut_out ? picture.pixels[4 * i + 3] : (color.x + color.y + color.z) / 3;
  }
  RefuseZeroAndOne(mask, path);
  return mask;
}

}  // namespace regrade
