// A dense motion field: the position of each pixel of one image in another.
#pragma once

#include <cstddef>
#include <vector>

namespace regrade {

// Shape [height, width, 2]: the pixel (x, y) of the first image is at (x + u, y + v) in the
// second; in pixels. A value that is not finite means "unknown".
struct FlowField {
  int width = 0;
  int height = 0;
  std::vector<float> uv;

  FlowField() = default;
  FlowField(int width, int height)
      : width(width), height(height), uv(static_cast<size_t>(width) * height * 2) {}

  float* at(int x, int y) { return &uv[(static_cast<size_t>(y) * width + x) * 2]; }
  const float* at(int x, int y) const { return &uv[(static_cast<size_t>(y) * width + x) * 2]; }
  bool SameSize(const FlowField& o) const { return width == o.width && height == o.height; }
};

}  // namespace regrade
