// Backward scan of EQ(composite-adjoint) over the samples of a warp. Device code only.
#pragma once

#include "kernels/field/cuda/warp_march.h"

#if defined(__CUDACC__)

namespace regrade {

// The radiance behind each lane's sample, with lane 0 the farthest. The recursion R_i =
// alpha_i c_i + (1 - alpha_i) R_{i+1} composes maps x -> b + a x; 32 of them are composed by a
// scan. All a and b are non-negative, so nothing cancels. *behind is the radiance behind lane 0
// on entry and the radiance R of lane 31 on return.
__device__ inline Vec3f BackgroundRadiance(float a, Vec3f b, int lane, Vec3f* behind) {
#pragma unroll
  for (int d = 1; d < 32; d *= 2) {
    const float other_a = __shfl_up_sync(kAllLanes, a, d);
    Vec3f other_b;
    for (int c = 0; c < 3; ++c) other_b[c] = __shfl_up_sync(kAllLanes, b[c], d);
    if (lane >= d) {
      b += other_b * a;
      a *= other_a;
    }
  }
  // The composition of all lanes before this one, whose samples are farther away.
  float up_a = __shfl_up_sync(kAllLanes, a, 1);
  Vec3f up_b;
  for (int c = 0; c < 3; ++c) up_b[c] = __shfl_up_sync(kAllLanes, b[c], 1);
  if (lane == 0) up_a = 1, up_b = {};
  const Vec3f seen = up_b + *behind * up_a;
  const float last_a = __shfl_sync(kAllLanes, a, 31);
  for (int c = 0; c < 3; ++c)
    (*behind)[c] = __shfl_sync(kAllLanes, b[c], 31) + last_a * (*behind)[c];
  return seen;
}

}  // namespace regrade

#endif
