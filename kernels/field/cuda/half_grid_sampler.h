// Samples a HalfGrid during a march. Device code only.
#pragma once

#include "kernels/field/cuda/half_grid.h"
#include "kernels/field/cuda/warp_march.h"

#if defined(__CUDACC__)

#include <cuda_fp16.h>

namespace regrade {

class HalfGridSampler {
 public:
  __device__ explicit HalfGridSampler(const HalfGridView& grid) : grid_(grid) {}
  __device__ const Vec3f& last() const { return grid_.last; }
  __device__ int Index(int x, int y, int z) const { return grid_.order.Index(x, y, z); }
  // At a brick's face the step leads into the next brick.
  __device__ NeighbourSteps Steps(int vertex) const {
    return {(vertex >> 4 & 3) == 3 ? grid_.order.slab - 48 : 16,
            (vertex >> 2 & 3) == 3 ? grid_.order.row - 12 : 4, (vertex & 3) == 3 ? 61 : 1};
  }
  __device__ int Distance(int vertex) const { return grid_.empty_distance[vertex]; }
  __device__ int32_t Link(int vertex) const { return grid_.links[vertex]; }
  // The GPU's fast exponential: its relative error, 2^-21 for these depths, and that of its
  // difference from 1 are far below the error of half precision.
  __device__ static float Exp(float x) { return __expf(x); }
  __device__ static float Alpha(float tau) { return 1 - __expf(-tau); }
  __device__ float DensityBetween(int vertex, float fraction) const {
    const uint32_t word = grid_.density_pairs[vertex];
    const float2 pair = __half22float2(*reinterpret_cast<const __half2*>(&word));
    return pair.x * (1 - fraction) + pair.y * fraction;
  }

 private:
  const HalfGridView& grid_;
};

}  // namespace regrade

#endif
