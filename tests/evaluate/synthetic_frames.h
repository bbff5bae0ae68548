// Frames and flows with known content for the evaluator's tests.
#pragma once

#include <cmath>
#include <limits>
#include <utility>

#include "evaluate/consistency.h"
#include "kernels/base/random.h"
#include "tests/support/pictures.h"

namespace regrade::testing {

inline constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// A texture that optical flow can track: waves of several lengths, shifted by (dx, dy) pixels.
inline Image WaveImage(int width, int height, double dx, double dy) {
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c) {
        const double u = x - dx, v = y - dy;
        image.at(x, y)[c] =
            static_cast<float>(0.5 + 0.15 * std::sin(0.37 * u + 0.2 * v + c) +
                               0.15 * std::sin(0.11 * u - 0.31 * v) +
                               0.1 * std::sin(0.05 * u * std::cos(0.02 * v) + 0.07 * v));
      }
  return image;
}

inline FlowField ConstantFlow(int width, int height, float u, float v) {
  FlowField flow(width, height);
  for (size_t i = 0; i < flow.uv.size(); i += 2) flow.uv[i] = u, flow.uv[i + 1] = v;
  return flow;
}

// Smooth flow with a discontinuity, and a backward flow that inverts it up to a smooth error,
// so that every branch of a mask is taken somewhere.
inline std::pair<FlowField, FlowField> MixedFlows(int width, int height, uint64_t seed) {
  FlowField forward(width, height), backward(width, height);
  const double phase = 6.28 * RandomDouble(seed, 1, 0), tilt = RandomDouble(seed, 1, 1);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double s = std::sin(0.03 * x + 0.02 * y + phase);
      const double grain =
          seed % 2 ? 0.9 + 0.2 * RandomDouble(seed, 2, static_cast<uint64_t>(y) * width + x)
                   : 1;
      const double u = 6 * s + (x + tilt * y > 0.6 * width ? 4 : 0);
      const double v = 3 * std::cos(0.025 * x - 0.04 * y + 2 * phase);
      const double wrong = 1.2 * std::sin(0.05 * y + phase) * std::cos(0.04 * x);
      forward.at(x, y)[0] = static_cast<float>(grain * u);
      forward.at(x, y)[1] = static_cast<float>(grain * v);
      backward.at(x, y)[0] = static_cast<float>(-u + wrong);
      backward.at(x, y)[1] = static_cast<float>(-v + 0.5 * wrong);
    }
  return {forward, backward};
}

inline PairMotion StillMotion(int width, int height, float weight = 1) {
  return {ConstantFlow(width, height, 0, 0), {ConstantImage(width, height, weight, 1)}};
}

inline FrameSource Frames(std::vector<Image> images) {
  const int count = static_cast<int>(images.size());
  return {count, [images = std::move(images)](int i) { return images.at(i); }};
}

}  // namespace regrade::testing
