#include "kernels/splats/cuda/dense_adjoint.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

struct StoreGradient {
  float *mean, *log_scale, *quaternion, *opacity_logit, *sh;

  __device__ void Shape(int64_t i, const Splat<float>& d) const {
    for (int a = 0; a < 3; ++a) {
      mean[3 * i + a] = d.mean[a];
      log_scale[3 * i + a] = d.log_scale[a];
    }
    reinterpret_cast<float4*>(quaternion)[i] = {d.quaternion[0], d.quaternion[1],
                                                d.quaternion[2], d.quaternion[3]};
    opacity_logit[i] = d.opacity_logit;
  }
  template <int kCount>
  __device__ void Color(int64_t at, int, const float* d) const {
    if constexpr (kCount == 4)
      reinterpret_cast<float4*>(sh)[at / 4] = {d[0], d[1], d[2], d[3]};
    else
      sh[at] = d[0];
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
