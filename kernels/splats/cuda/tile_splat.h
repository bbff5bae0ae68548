// A splat as the pixels of a tile see it, in numbers that make a pixel cheap. Device code only.
#pragma once

#include "kernels/splats/cuda/device_math.h"
#include "kernels/splats/cuda/splat_record.h"

#if defined(__CUDACC__)

namespace regrade {

// Offsets are whitened and scaled, w' = sqrt(log2(e) / 2) w, so that log2(alpha) = lo - |w'|^2.
// Forward and adjoint call the same functions, of single operations: both decide alike.
struct alignas(16) TileSplat {
  // At the tile's pixel (x, y): w'_0 = w0 + a x, w'_1 = w1 + ka x + b y.
  float a = 0, w0 = 0, ka = 0, w1 = 0;
  float b = 0, lo = -1000;
  Vec3f color;
  float z = 0;

  TileSplat() = default;  // seen nowhere
  // `left` and `top`: the tile's first pixel.
  __device__ TileSplat(const SplatRecord& r, int left, int top) : color(r.color), z(r.z) {
    const float dx = static_cast<float>(left + 0.5 - r.u);
    const float dy = static_cast<float>(top + 0.5 - r.v);
    const float inverse = FastReciprocal(r.c11);
    a = __fmul_rn(kScale, FastReciprocal(r.c00));
    b = __fmul_rn(kScale, inverse);
    const float k = -__fmul_rn(r.c10, inverse);
    w0 = __fmul_rn(dx, a);
    ka = __fmul_rn(k, a);
    w1 = __fmaf_rn(k, w0, __fmul_rn(dy, b));
    lo = __fmul_rn(r.log_opacity, 1.4426950408889634f);
  }

  __device__ float Across(float x) const { return __fmaf_rn(x, a, w0); }  // w'_0
  __device__ float Slant(float x) const { return __fmaf_rn(x, ka, w1); }
  // w'_1; `slant`: of the same x.
  __device__ float Along(float slant, float y) const { return __fmaf_rn(y, b, slant); }
  // log2(alpha).
  __device__ float Exponent(float across, float along) const {
    return __fmaf_rn(-along, along, __fmaf_rn(-across, across, lo));
  }
  static __device__ bool Sees(float exponent) {
    return exponent >= float(kLogMinAlpha * 1.4426950408889634);
  }

  static constexpr float kScale = 0.8493218002880191f;  // sqrt(log2(e) / 2)
};

}  // namespace regrade

#endif
