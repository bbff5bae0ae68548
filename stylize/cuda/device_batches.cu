#include "kernels/device/device_stream.h"
#include "kernels/device/launch_size.h"
#include "stylize/cuda/device_batches.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

__global__ void TakeBatchKernel(const Ray* rays, const Vec3f* targets, int64_t per_step,
                                int64_t steps, const int64_t* step, Ray* step_rays,
                                Vec3f* step_targets) {
  const int64_t r = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (r >= per_step) return;
  const int64_t from = *step % steps * per_step + r;
  step_rays[r] = rays[from];
  step_targets[r] = targets[from];
}

}  // namespace

void TakeBatch(const DeviceBatches& batches, const int64_t* step, Ray* step_rays,
               Vec3f* step_targets) {
  TakeBatchKernel<<<BlocksFor(batches.per_step), kThreads, 0, LaunchStream()>>>(
      batches.rays.data(), batches.targets.data(), batches.per_step, batches.steps, step,
      step_rays, step_targets);
  CheckLaunch("take_batch");
}

#else

void TakeBatch(const DeviceBatches&, const int64_t*, Ray*, Vec3f*) { DeviceWait("take_batch"); }

#endif

}  // namespace regrade
