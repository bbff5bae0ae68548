// What kernels see of a gradient: its rows have the grid's stride. Device code only.
#pragma once

#include <cstdint>

#if defined(__CUDACC__)

namespace regrade {

struct GradientView {
  float* gradient;
  uint32_t* touched;
};

__device__ inline void Touch(uint32_t* touched, int32_t voxel) {
  uint32_t* word = touched + (voxel >> 5);
  const uint32_t bit = 1u << (voxel & 31);
  if ((*word & bit) == 0) atomicOr(word, bit);  // most have been marked by another ray already
}

}  // namespace regrade

#endif
