// An image in memory: row-major, interleaved channels, sRGB-encoded values nominally in [0, 1].
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "kernels/base/vec.h"

namespace regrade {

// Shape [height, width, channels]; channels is 1 (grey, depth, mask), 3 (RGB) or 4 (RGB +
// straight alpha).
struct Image {
  int width = 0;
  int height = 0;
  int channels = 3;
  std::vector<float> pixels;

  Image() = default;
  Image(int width, int height, int channels = 3)
      : width(width),
        height(height),
        channels(channels),
        pixels(static_cast<size_t>(width) * height * channels) {}

  bool empty() const { return pixels.empty(); }
  int64_t num_pixels() const { return static_cast<int64_t>(width) * height; }
  float* at(int x, int y) { return &pixels[(static_cast<size_t>(y) * width + x) * channels]; }
  const float* at(int x, int y) const {
    return &pixels[(static_cast<size_t>(y) * width + x) * channels];
  }
  bool SameSize(const Image& o) const { return width == o.width && height == o.height; }
};

// Whether any pixel has finite values in all channels.
inline bool HasColor(const Image& image) {
  for (int64_t p = 0; p < image.num_pixels(); ++p) {
    bool finite = true;
    for (int c = 0; c < image.channels; ++c)
      finite &= std::isfinite(image.pixels[p * image.channels + c]);
    if (finite) return true;
  }
  return false;
}

}  // namespace regrade
