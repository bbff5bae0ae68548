// Encodes PNG and JPEG files in memory, with libpng and libjpeg.
#pragma once

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "kernels/scene/image.h"

namespace regrade {

// Values are clamped to [0, 1] and rounded half up; NaN becomes 0.
template <typename Value>
std::vector<Value> Quantized(const Image& image) {
  constexpr float kMax = std::numeric_limits<Value>::max();
  std::vector<Value> values(image.pixels.size());
  std::transform(image.pixels.begin(), image.pixels.end(), values.begin(), [](float v) {
    return v > 0 ? static_cast<Value>(std::min(v, 1.f) * kMax + 0.5f) : Value{0};
  });
  return values;
}

// `tagged`: the file says that its colours are sRGB. Both throw Error(kResources).

// 1, 3 or 4 channels (straight alpha), `bits` 8 or 16, zlib's `level` 0 to 9.
std::string EncodePng(const Image& image, int bits, int level, bool tagged);
// 1 or 3 channels; `quality` 1 to 100.
std::string EncodeJpeg(const Image& image, int quality, bool tagged);

}  // namespace regrade
