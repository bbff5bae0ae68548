#include "kernels/image/gaussian_blur.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// One axis: `count` pixels `stride` floats apart in each of `lines` lines.
struct Axis {
  int lines, count;
  int64_t line_stride, stride;
};

void BlurAlong(const Axis& axis, int channels, const std::vector<double>& taps,
               const Image& from, Image* to) {
  const int radius = static_cast<int>(taps.size()) - 1;
#pragma omp parallel for schedule(static)
  for (int line = 0; line < axis.lines; ++line)
    for (int at = 0; at < axis.count; ++at) {
      double sum[4] = {}, weight = 0;
      const int first = std::max(at - radius, 0), last = std::min(at + radius, axis.count - 1);
      for (int k = first; k <= last; ++k) {
        const double tap = taps[std::abs(k - at)];
        const float* value = &from.pixels[line * axis.line_stride + k * axis.stride];
        for (int c = 0; c < channels; ++c) sum[c] += tap * value[c];
        weight += tap;
      }
      float* value = &to->pixels[line * axis.line_stride + at * axis.stride];
      for (int c = 0; c < channels; ++c) value[c] = static_cast<float>(sum[c] / weight);
    }
}

}  // namespace

Image GaussianBlur(const Image& image, double sigma) {
  REGRADE_CHECK(sigma > 0 && image.channels <= 4);
  std::vector<double> taps;
  for (int k = 0; k <= std::ceil(3 * sigma); ++k)
    taps.push_back(std::exp(-k * k / (2 * sigma * sigma)));
  const int64_t pixel = image.channels, row = pixel * image.width;
  Image rows(image.width, image.height, image.channels), both = rows;
  BlurAlong({image.height, image.width, row, pixel}, image.channels, taps, image, &rows);
  BlurAlong({image.width, image.height, pixel, row}, image.channels, taps, rows, &both);
  return both;
}

}  // namespace regrade
