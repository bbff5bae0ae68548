// Work that a warp of threads does on one item each. Device code only.
#pragma once

#include <cstdint>

#if defined(__CUDACC__)

namespace regrade {

// The item that a warp works on, or -1 beyond n and, unless it is null, *counted.
__device__ inline int64_t ItemOfWarp(int64_t n, const int32_t* counted) {
  const int64_t i = (blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x) / 32;
  return i < n && (counted == nullptr || i < *counted) ? i : -1;
}

}  // namespace regrade

#endif
