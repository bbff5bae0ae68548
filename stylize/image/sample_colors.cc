#include "stylize/image/sample_colors.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"

namespace regrade {

std::vector<Vec3d> SampleColors(const Image& image, const std::string& where, int64_t most,
                                std::vector<double>* heights) {
  std::vector<Vec3d> all;
  std::vector<int64_t> pixels;
  const bool grey = image.channels < 3;
  for (int64_t i = 0; i < image.num_pixels(); ++i) {
    const float* p = &image.pixels[i * image.channels];
    if (image.channels == 4 && !(p[3] > 0.5f)) continue;
    const Vec3d color{p[0], p[grey ? 0 : 1], p[grey ? 0 : 2]};
    if (!std::isfinite(color.x + color.y + color.z)) continue;
    all.push_back(color);
    pixels.push_back(i);
  }
  if (all.empty()) throw InputError("the picture has no pixel to take a colour of", where);
  const int64_t count = std::ssize(all), kept = std::min(count, most);
  // By index, not by a whole stride: a stride that divides the width would see few columns.
  std::vector<Vec3d> sample(kept);
  if (heights != nullptr) heights->assign(kept, 0);
  for (int64_t i = 0; i < kept; ++i) {
    const int64_t drawn = i * count / kept;
    sample[i] = all[drawn];
    if (heights == nullptr) continue;
    const auto row = static_cast<double>(pixels[drawn] / image.width);
    (*heights)[i] = 1 - (row + 0.5) / image.height;
  }
  return sample;
}

}  // namespace regrade
