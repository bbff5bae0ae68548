// One splat's values in a thread's registers, as a SplatsView for the specification's
// functions. Device code only.
#pragma once

#include "kernels/splats/splats.h"

#if defined(__CUDACC__)

namespace regrade {

template <int kBasis>
struct OwnSplat {
  Splat<float> values;
  float sh[3 * kBasis];

  // Everything but the colour. The quaternions must be aligned to 16 bytes.
  __device__ void LoadShape(const SplatsView<float>& splats, int64_t i) {
    for (int a = 0; a < 3; ++a) {
      values.mean[a] = splats.mean[3 * i + a];
      values.log_scale[a] = splats.log_scale[3 * i + a];
    }
    const float4 q = reinterpret_cast<const float4*>(splats.quaternion)[i];
    values.quaternion[0] = q.x, values.quaternion[1] = q.y;
    values.quaternion[2] = q.z, values.quaternion[3] = q.w;
    values.opacity_logit = splats.opacity_logit[i];
  }

  // The coefficients must be aligned to 16 bytes.
  __device__ void LoadColor(const SplatsView<float>& splats, int64_t i) {
    const float* const from = splats.sh + 3 * kBasis * i;
    if constexpr (kBasis % 4 == 0) {
#pragma unroll
      for (int k = 0; k < 3 * kBasis / 4; ++k) {
        const float4 four = reinterpret_cast<const float4*>(from)[k];
        sh[4 * k] = four.x, sh[4 * k + 1] = four.y, sh[4 * k + 2] = four.z,
               sh[4 * k + 3] = four.w;
      }
    } else {
#pragma unroll
      for (int k = 0; k < 3 * kBasis; ++k) sh[k] = from[k];
    }
  }

  // Of this splat alone, as splat 0. `basis` 0: without its colour.
  __device__ SplatsView<float> view(int basis = kBasis) const {
    return {
        &values.mean.x, &values.log_scale.x, values.quaternion, &values.opacity_logit, sh, 1,
        basis};
  }
};

}  // namespace regrade

#endif
