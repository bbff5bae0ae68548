#include "kernels/device/device_stream.h"
#include "kernels/device/launch_size.h"
#include "kernels/field/cuda/gradient_view.h"
#include "stylize/cuda/device_color_loss.h"
#include "stylize/field/color_error.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

__global__ void ColorLossKernel(const Vec3f* color, const Vec3f* targets,
                                const float* transmittance, int64_t n, ColorLossRule rule,
                                Vec3f* d_color, DeviceColorLoss* sums) {
  const int64_t r = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  double loss = 0, shown = 0;
  unsigned counts = 0;
  if (r < n) {
    const Vec3f target = targets[r];
    Vec3f d{0, 0, 0};
    if (isfinite(target.x) && isfinite(target.y) && isfinite(target.z) &&
        transmittance[r] <= rule.max_transmittance) {
      counts = 1;
      for (int c = 0; c < 3; ++c) {
        const ColorError error = ErrorOf(color[r][c], target[c], rule.one_sided);
        loss += static_cast<double>(error.loss) * error.loss;
        shown += static_cast<double>(error.shown) * error.shown;
        d[c] = 2 * error.loss;
      }
      loss = ExactTerm(loss);
      shown = ExactTerm(shown);
    }
    d_color[r] = d;
  }
#pragma unroll
  for (int other = 16; other > 0; other /= 2) {
    loss += __shfl_xor_sync(0xffffffffu, loss, other);
    shown += __shfl_xor_sync(0xffffffffu, shown, other);
    counts += __shfl_xor_sync(0xffffffffu, counts, other);
  }
  if ((threadIdx.x & 31) != 0 || counts == 0) return;
  atomicAdd(&sums->loss, loss);
  atomicAdd(&sums->squared_error, shown);
  atomicAdd(&sums->rays, static_cast<unsigned long long>(counts));
}

}  // namespace

void AddColorLoss(const Vec3f* color, const Vec3f* targets, const float* transmittance,
                  int64_t n, const ColorLossRule& rule, Vec3f* d_color, DeviceColorLoss* sums) {
  if (n == 0) return;
  ColorLossKernel<<<BlocksFor(n), kThreads, 0, LaunchStream()>>>(color, targets, transmittance,
                                                                 n, rule, d_color, sums);
  CheckLaunch("color_loss");
}

#else

void AddColorLoss(const Vec3f*, const Vec3f*, const float*, int64_t, const ColorLossRule&,
                  Vec3f*, DeviceColorLoss*) {
  DeviceWait("color_loss");
}

#endif

}  // namespace regrade
