// What kernels see of a gradient: its rows have the grid's stride.
#pragma once

#include <cmath>
#include <cstdint>

namespace regrade {

// Sums that do not depend on their order: 64-bit integers in units of 2^-44. A fit's gradients
// are far below the 5e5 that fit in; what is not finite leaves a mark that no sum reaches.
inline constexpr float kExactUnit = 0x1p-44f;
inline constexpr long long kNotFinite = 1ll << 62;

}  // namespace regrade

#if defined(__CUDACC__)

namespace regrade {

struct GradientView {
  float* gradient;
  uint32_t* touched;
};

__device__ inline void AddExact(float* gradient, int value, float v) {
  auto* const sum = reinterpret_cast<unsigned long long*>(gradient) + value;
  if (isfinite(v))
    atomicAdd(sum, static_cast<unsigned long long>(
                       llrint(static_cast<double>(v) * (1.0 / double{kExactUnit}))));
  else
    atomicExch(sum, static_cast<unsigned long long>(kNotFinite));  // added, marks would cancel
}
__device__ inline float ExactSum(const float* gradient, int value) {
  const long long units = reinterpret_cast<const long long*>(gradient)[value];
  if (units > kNotFinite / 2 || units < -kNotFinite / 2) return INFINITY;
  return static_cast<float>(static_cast<double>(units) * kExactUnit);
}

__device__ inline void Touch(uint32_t* touched, int32_t voxel) {
  uint32_t* word = touched + (voxel >> 5);
  const uint32_t bit = 1u << (voxel & 31);
  if ((*word & bit) == 0) atomicOr(word, bit);  // most have been marked by another ray already
}

}  // namespace regrade

#endif
