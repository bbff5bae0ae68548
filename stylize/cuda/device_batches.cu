#include <algorithm>

#include "kernels/device/device_stream.h"
#include "kernels/device/launch_size.h"
#include "kernels/field/cuda/gradient_view.h"
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

__global__ void TakeSamplesKernel(SplatSamplesView from, int64_t groups, int64_t rays,
                                  const int64_t* step, DeviceWeightedSample* samples,
                                  int64_t room, float* transmittance, int32_t* counter,
                                  uint32_t* touched) {
  const int64_t i = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  const int64_t group = step != nullptr ? *step % groups : 0;
  const int32_t count = from.count[group];
  if (i == 0) *counter = count;
  if (i < rays) transmittance[i] = from.transmittance[group * rays + i];
  if (i >= count || i >= room) return;
  const SplatSample sample = from.sample[group * from.capacity + i];
  samples[i] = {sample.splat, sample.direction, sample.weight, sample.ray};
  if (touched != nullptr) Touch(touched, sample.splat);
}

}  // namespace

void TakeBatch(const DeviceBatches& batches, const int64_t* step, Ray* step_rays,
               Vec3f* step_targets) {
  TakeBatchKernel<<<BlocksFor(batches.per_step), kThreads, 0, LaunchStream()>>>(
      batches.rays.data(), batches.targets.data(), batches.per_step, batches.steps, step,
      step_rays, step_targets);
  CheckLaunch("take_batch");
}

void TakeSamples(const DeviceSplatSamples& samples, const int64_t* step,
                 DeviceRayWeights* weights, DeviceTouched* touched) {
  weights->num_rays = samples.rays;
  weights->num_samples = weights->samples.size();
  const int64_t most = std::max(weights->num_samples, samples.rays);
  TakeSamplesKernel<<<BlocksFor(most), kThreads, 0, LaunchStream()>>>(
      samples.view(), samples.groups, samples.rays, step, weights->samples.data(),
      weights->num_samples, weights->transmittance.data(), weights->counter.data(),
      touched != nullptr ? touched->bits.data() : nullptr);
  CheckLaunch("take_samples");
}

#else

void TakeBatch(const DeviceBatches&, const int64_t*, Ray*, Vec3f*) { DeviceWait("take_batch"); }
void TakeSamples(const DeviceSplatSamples&, const int64_t*, DeviceRayWeights*, DeviceTouched*) {
  DeviceWait("take_samples");
}

#endif

}  // namespace regrade
