// What a convolutional network passes from layer to layer: planes of numbers over a picture.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace regrade {

// Shape [channels, height, width], row-major.
struct FeatureMap {
  int channels = 0;
  int height = 0;
  int width = 0;
  std::vector<float> values;

  FeatureMap() = default;
  FeatureMap(int channels, int height, int width)
      : channels(channels),
        height(height),
        width(width),
        values(static_cast<size_t>(channels) * height * width) {}

  int64_t num_pixels() const { return static_cast<int64_t>(height) * width; }
  float* plane(int c) { return &values[c * num_pixels()]; }
  const float* plane(int c) const { return &values[c * num_pixels()]; }
};

}  // namespace regrade
