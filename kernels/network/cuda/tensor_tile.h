// Products of small matrices by a warp on the tensor cores. Device code only.
//
// A warp holds 16 rows of K values as tiles of 8 columns, four registers a lane: lane 4 g + t
// has, of tile j, rows g (first two) and g + 8 (last two) at columns 8 j + 2 t and 8 j + 2 t
// + 1. This is the layout in which the tensor cores return a product (mma.m16n8). They expect
// the left factor in another order, columns t and t + 4; but the order of the sum over k is
// free, so column 2 t is used for t and 2 t + 1 for t + 4, in both factors, and one layer's
// output is the next one's input without a shuffle.
#pragma once

#include <cstdint>

#if defined(__CUDACC__)

namespace regrade {

struct Tile {
  float x[4];  // (g, 2t), (g, 2t + 1), (g + 8, 2t), (g + 8, 2t + 1)
};

// sum += left * right for 8 values of k: right[0] = R[2t][g], right[1] = R[2t + 1][g] of the
// tile's [k, n].
#if __CUDA_ARCH__ >= 800

__device__ inline uint32_t RoundToTensor(float x) {
  uint32_t bits;
  asm("cvt.rna.tf32.f32 %0, %1;" : "=r"(bits) : "f"(x));
  return bits;
}

__device__ inline void MultiplyRounded(Tile* sum, const uint32_t (&a)[4],
                                       const uint32_t (&b)[2]) {
  asm volatile(
      "mma.sync.aligned.m16n8k8.row.col.f32.tf32.tf32.f32 {%0,%1,%2,%3}, {%4,%5,%6,%7}, "
      "{%8,%9}, {%0,%1,%2,%3};"
      : "+f"(sum->x[0]), "+f"(sum->x[1]), "+f"(sum->x[2]), "+f"(sum->x[3])
      : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b[0]), "r"(b[1]));
}

template <bool kSplit>
__device__ inline void Multiply(Tile* sum, const Tile& left, const float (&right)[2]) {
  const float in_order[4] = {left.x[0], left.x[2], left.x[1], left.x[3]};
  uint32_t a[4], b[2];
#pragma unroll
  for (int i = 0; i < 4; ++i) a[i] = RoundToTensor(in_order[i]);
#pragma unroll
  for (int i = 0; i < 2; ++i) b[i] = RoundToTensor(right[i]);
  if constexpr (kSplit) {  // the rounding residuals, multiplied first: small terms before
                           // large ones
    uint32_t rest_a[4], rest_b[2];
#pragma unroll
    for (int i = 0; i < 4; ++i) rest_a[i] = RoundToTensor(in_order[i] - __uint_as_float(a[i]));
#pragma unroll
    for (int i = 0; i < 2; ++i) rest_b[i] = RoundToTensor(right[i] - __uint_as_float(b[i]));
    MultiplyRounded(sum, rest_a, b);
    MultiplyRounded(sum, a, rest_b);
  }
  MultiplyRounded(sum, a, b);
}

#else

// Without TF32: the same sums by shuffles, slower.
template <bool kSplit>
__device__ inline void Multiply(Tile* sum, const Tile& left, const float (&right)[2]) {
  const int lane = static_cast<int>(threadIdx.x & 31), g = lane / 4, t = lane % 4;
#pragma unroll
  for (int k = 0; k < 8; ++k) {
    const float low = __shfl_sync(0xffffffffu, left.x[k % 2], 4 * g + k / 2);
    const float high = __shfl_sync(0xffffffffu, left.x[2 + k % 2], 4 * g + k / 2);
#pragma unroll
    for (int n = 0; n < 2; ++n) {
      const float r = __shfl_sync(0xffffffffu, right[k % 2], 4 * (2 * t + n) + k / 2);
      sum->x[n] += low * r;
      sum->x[2 + n] += high * r;
    }
  }
}

#endif

}  // namespace regrade

#endif
