// Rays through a field on a CUDA device: rendering, fitting's forward and adjoint in one kernel, and the
// largest weights. Held to ray_loss.h by the parity table. A warp walks a ray; its lanes first look at 32
// samples at a time, then stand for the values of a voxel.
#pragma once

#include "kernels/field/device/device_grid.h"
#include "kernels/field/fast_rays.h"
#include "kernels/field/ray_march.h"

namespace regrade {

// color [n] not clipped, depth [n] = sum w t (world), transmittance [n]; all on the device.
struct DeviceRenderTarget {
  Vec3f* color = nullptr;
  float* depth = nullptr;
  float* transmittance = nullptr;
};
void RenderOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n, const MarchOptions& options,
                    const DeviceRenderTarget& target);

// Sums over many steps; read them seldom, reading waits for the device.
struct DeviceFitSums {
  double squared_error = 0;
  unsigned long long samples = 0;
  unsigned long long rejected_voxels = 0;
};

// Gradient of a field on the device: dense records, and the list of those that were touched.
class DeviceGradient {
 public:
  DeviceGradient() = default;
  explicit DeviceGradient(const DeviceGrid& grid);

  DeviceBuffer<float> gradient;   // [N, lanes], 0 where untouched
  DeviceBuffer<int32_t> touched;  // [N]: 1 where the gradient may differ from 0
  DeviceBuffer<int32_t> list;     // [N]: touched voxels, in no order
  DeviceBuffer<int32_t> count;    // [1]
};

// Forward, loss and adjoint of a batch: adds the gradient of scale * sum (C - target)^2. Float sums in no
// fixed order: two runs differ in the last bits.
class DeviceRayFitter {
 public:
  // Keeps every sample of the rays in flight; `max_bytes` bounds that store.
  DeviceRayFitter(const GridFrame& frame, const MarchOptions& options, int64_t max_bytes);
  void Accumulate(const DeviceGrid& grid, const Ray* rays, const Vec3f* targets, int64_t n,
                  float scale, DeviceGradient* gradient);
  DeviceFitSums TakeSums();  // and sets them to zero
  DeviceFitSums* sums() { return sums_.data(); }

 private:
  MarchOptions options_;
  int64_t capacity_ = 0;  // samples a ray
  int warps_ = 0;
  DeviceBuffer<float> store_;
  DeviceBuffer<int32_t> next_ray_;
  DeviceBuffer<DeviceFitSums> sums_;
};

// weights [N] hold running maxima of w_i over the samples whose cell has the voxel as a corner.
void MaxWeightsOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n,
                        const MarchOptions& options, float* weights);

// Adds the gradient of the total variation (see EQ(total-variation)) of voxels begin, begin + 1, ...,
// begin + count - 1, modulo their number.
void AddTotalVariation(const DeviceGrid& grid, int64_t begin, int64_t count, float scale_density,
                       float scale_sh, DeviceGradient* gradient);

// See EQ(rmsprop): steps the touched voxels and forgets their gradients. second_moment [N, lanes].
void StepOnDevice(DeviceGrid* grid, float* second_moment, DeviceGradient* gradient,
                  const RmspropOptions& options, DeviceFitSums* sums);

}  // namespace regrade
