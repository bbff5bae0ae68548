// Small pictures with smooth waves, an edge and some grain, like small photos.
#pragma once

#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"
#include "kernels/base/vec.h"
#include "kernels/scene/image.h"

namespace regrade::testing {

inline Image WavyPicture(int width, int height, const Vec3d& tint) {
  Image image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c) {
        const double wave = 0.25 * std::sin(x * 0.11 + c) + 0.2 * std::cos(y * 0.07 - c);
        const double edge = x + y > width ? 0.15 : -0.1;
        const double grain =
            0.04 * (RandomDouble(9, c, static_cast<uint64_t>(y) * width + x) - 0.5);
        image.at(x, y)[c] =
            static_cast<float>(std::clamp(tint[c] * (0.5 + wave + edge) + grain, 0.0, 1.0));
      }
  return image;
}

inline double LargestDifference(const Image& a, const Image& b) {
  double largest = a.pixels.size() == b.pixels.size() ? 0 : INFINITY;
  for (size_t i = 0; i < a.pixels.size() && i < b.pixels.size(); ++i)
    largest = std::max<double>(largest, std::abs(a.pixels[i] - b.pixels[i]));
  return largest;
}

}  // namespace regrade::testing
