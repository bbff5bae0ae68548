// A gradient as kernels see it: rows of the grid's stride per voxel, four values per texel.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/field/cuda/device_rays.h"

namespace regrade {

// Order-independent sums: 64-bit integers in units of 2^-44. Gradients and colours are far
// below the range of 1.3e5; a value that is not finite or beyond kExactLimit leaves a mark that
// no sum reaches.
inline constexpr float kExactUnit = 0x1p-44f, kExactLimit = 0x1p18f;
inline constexpr long long kNotFinite = 1ll << 62;

struct GradientView {
  float* gradient;
  uint32_t* touched;
};

// The gradient of the background's layers, of a field that is being fitted.
inline GradientView TexelGradient(const DeviceGrid& grid, DeviceTouched* touched) {
  return {grid.spheres.gradient.data(), touched->bits.data() + grid.first_texel() / 32};
}

}  // namespace regrade

#if defined(__CUDACC__)

namespace regrade {

__device__ inline void AddExact(float* gradient, int value, float v) {
  auto* const sum = reinterpret_cast<unsigned long long*>(gradient) + value;
  if (fabsf(v) < kExactLimit)
    atomicAdd(sum, static_cast<unsigned long long>(
                       llrint(static_cast<double>(v) * (1.0 / double{kExactUnit}))));
  else
    atomicExch(sum, static_cast<unsigned long long>(kNotFinite));  // adding marks would cancel
}
__device__ inline float ExactSum(const float* gradient, int value) {
  const long long units = reinterpret_cast<const long long*>(gradient)[value];
  if (units > kNotFinite / 2 || units < -kNotFinite / 2) return INFINITY;
  return static_cast<float>(static_cast<double>(units) * kExactUnit);
}

// A term of a statistic, rounded to a multiple of 2^-26: a sum of such terms in double is exact
// below 2^27, and so the same in any order.
__device__ inline double ExactTerm(double v) { return rint(v * 0x1p26) * 0x1p-26; }

__device__ inline void Touch(uint32_t* touched, int32_t voxel) {
  uint32_t* word = touched + (voxel >> 5);
  const uint32_t bit = 1u << (voxel & 31);
  if ((*word & bit) == 0) atomicOr(word, bit);  // most are already marked by another ray
}

__device__ inline void AddQuad(float* target, const float4& v) {
#if __CUDA_ARCH__ >= 900
  atomicAdd(reinterpret_cast<float4*>(target), v);
#else
  atomicAdd(target, v.x);
  atomicAdd(target + 1, v.y);
  atomicAdd(target + 2, v.z);
  atomicAdd(target + 3, v.w);
#endif
}

// Adds to a texel's four values and marks the texel.
template <bool kExact>
__device__ void AddTexel(const GradientView& gradient, int32_t texel, const float4& v) {
  if constexpr (kExact) {
    float* const row = gradient.gradient + int64_t{texel} * 8;
    AddExact(row, 0, v.x);
    AddExact(row, 1, v.y);
    AddExact(row, 2, v.z);
    AddExact(row, 3, v.w);
  } else {
    AddQuad(gradient.gradient + int64_t{texel} * 4, v);
  }
  Touch(gradient.touched, texel);
}

}  // namespace regrade

#endif
