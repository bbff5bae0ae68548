// Rays of several steps to come, and what they see of splats, on a CUDA device: each step takes
// its own without the host.
#pragma once

#include <cstdint>

#include "kernels/base/vec.h"
#include "kernels/device/device_memory.h"
#include "kernels/scene/camera.h"
#include "kernels/splats/cuda/device_splat_weigher.h"
#include "stylize/cuda/device_ray_weights.h"

namespace regrade {

struct DeviceBatches {
  DeviceBuffer<Ray> rays;       // [steps, per_step]
  DeviceBuffer<Vec3f> targets;  // the same
  int64_t per_step = 0, steps = 0;

  DeviceBatches() = default;
  DeviceBatches(int64_t rays_per_step, int64_t num_steps)
      : rays(rays_per_step * num_steps, "rays of steps to come"),
        targets(rays_per_step * num_steps, "colours of rays to come"),
        per_step(rays_per_step),
        steps(num_steps) {}
};

// step_rays, step_targets [per_step] = those of batch *step % steps; all on the device. Does
// not wait.
void TakeBatch(const DeviceBatches& batches, const int64_t* step, Ray* step_rays,
               Vec3f* step_targets);

// The samples of group *step % groups, or if `step` is null of the first one, take the place of
// those that DeviceRayWeights::Launch would march, in the room that Reserve has made. Marks are
// added to `touched` unless it is null. Does not wait.
void TakeSamples(const DeviceSplatSamples& samples, const int64_t* step,
                 DeviceRayWeights* weights, DeviceTouched* touched);

}  // namespace regrade
