#include "kernels/splats/cuda/dense_adjoint.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

struct StoreGradient {
  float *mean, *log_scale, *quaternion, *opacity_logit, *sh;

  template <int kBasis>
  __device__ void operator()(int64_t i, const Splat<float>& d,
                             const ShGradient<kBasis>& d_sh) const {
    for (int a = 0; a < 3; ++a) {
      mean[3 * i + a] = d.mean[a];
      log_scale[3 * i + a] = d.log_scale[a];
    }
    for (int a = 0; a < 4; ++a) quaternion[4 * i + a] = d.quaternion[a];
    opacity_logit[i] = d.opacity_logit;
    float* const to = sh + 3 * kBasis * i;
    if constexpr (kBasis % 4 == 0) {
#pragma unroll
      for (int k = 0; k < 3 * kBasis; k += 4)
        reinterpret_cast<float4*>(to)[k / 4] = {d_sh[k], d_sh[k + 1], d_sh[k + 2], d_sh[k + 3]};
    } else {
#pragma unroll
      for (int k = 0; k < 3 * kBasis; ++k) to[k] = d_sh[k];
    }
  }
};

}  // namespace

void StoreSplatGradients(const SplatSumsView& view, DeviceSplats* gradient) {
  if (gradient->basis != view.splats.basis) *gradient = DeviceSplats(0, view.splats.basis);
  gradient->count = 0;  // no values to keep
  gradient->Reserve(view.splats.count);
  gradient->count = view.splats.count;
  gradient->Zero();
  UseSplatGradients(view, StoreGradient{gradient->mean.data(), gradient->log_scale.data(),
                                        gradient->quaternion.data(),
                                        gradient->opacity_logit.data(), gradient->sh.data()});
  DeviceCopyOut(&gradient->background, view.d_background, sizeof gradient->background);
}

#else

void StoreSplatGradients(const SplatSumsView&, DeviceSplats*) { DeviceWait("splats"); }

#endif

}  // namespace regrade
