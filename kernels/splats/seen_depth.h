// Depths that a photo saw, as a term of a fit's loss: the picture's loss alone lets walls be
// thin where what is far behind them has their colour.
//
// EQ(splat-depth): pixel p of a photo saw a surface at depth d, with standard deviation sigma.
// With Z = sum w z and T of the pixel (see EQ(splat-composite)), what is clear counted as twice
// as deep, e = (Z + 2 d T) / d - 1 and t = max(0.01, sigma / d), over the N such pixels
//   L = mean t h(e / t),   h(x) = x^2 / 2 for |x| < 1, else |x| - 1 / 2,
//   d_Z = clamp(e / t, -1, 1) / (N d),   d_T = 2 d d_Z.
// A splat's opacity feels its depth over d: what lies far behind goes first.
#pragma once

#include <cstdint>

#include "kernels/base/host_device.h"

namespace regrade {

inline constexpr float kLeastDepthError = 0.01f;  // of the depth: splats are about as thick

struct SeenDepth {
  int32_t pixel = 0;  // y * width + x
  float depth = 1;    // z in camera coordinates, world units
  float error = 1;    // t
};

// This pixel's share of L, and its gradient by Z and T; `count`: N.
template <typename T>
HD T DepthLoss(const SeenDepth& seen, int64_t count, T z, T transmittance, T* d_z,
               T* d_transmittance) {
  const T depth = static_cast<T>(seen.depth), error = static_cast<T>(seen.error);
  const T n = static_cast<T>(count);
  const T x = (z / depth + 2 * transmittance - 1) / error, size = x < 0 ? -x : x;
  const T slope = (size < 1 ? x : x < 0 ? T(-1) : T(1)) / n;
  *d_z = slope / depth;
  *d_transmittance = 2 * slope;
  return error * (size < 1 ? x * x / 2 : size - T(0.5)) / n;
}

// Depths and transmittances of a picture, or a gradient by them, [H, W].
template <typename T>
struct DepthPixels {
  T *z, *transmittance;
};

// Writes the gradient of `weight` L at one of `count` pixels.
HD inline void WriteDepthGradient(const SeenDepth& seen, int64_t count, float weight,
                                  const DepthPixels<const float>& picture,
                                  const DepthPixels<float>& d) {
  float d_z, d_transmittance;
  DepthLoss(seen, count, picture.z[seen.pixel], picture.transmittance[seen.pixel], &d_z,
            &d_transmittance);
  d.z[seen.pixel] = weight * d_z;
  d.transmittance[seen.pixel] = weight * d_transmittance;
}

}  // namespace regrade
