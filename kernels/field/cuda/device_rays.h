// Rays through a field on a CUDA device: rendering, fitting's forward and adjoint pass in one
// kernel, and the largest weights. The parity table compares it with render_ray.h. A warp
// processes a ray; its lanes first march 32 samples at a time, then hold the values of a voxel.
#pragma once

#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/density_losses.h"
#include "kernels/field/ray_march.h"
#include "kernels/field/render.h"
#include "kernels/optimize/rmsprop.h"

namespace regrade {

// color [n] not clipped, depth [n] = sum w t (world), transmittance [n]; all on the device.
struct DeviceRenderTarget {
  Vec3f* color = nullptr;
  float* depth = nullptr;
  float* transmittance = nullptr;
};
void RenderOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n,
                    const MarchOptions& options, const DeviceRenderTarget& target);

// A frame at a camera without distortion: rays are generated and pixels resolved (see
// ResolvePixel) inside the kernel. `target` [height, width]; does not wait.
void RenderFrameOnDevice(const DeviceGrid& grid, const Camera& camera,
                         const MarchOptions& options, const DeviceRenderTarget& target);

// A whole view, colours clipped, depths along the optical axis; see render.h.
RenderedView RenderViewOnDevice(const DeviceGrid& grid, const Camera& camera,
                                const MarchOptions& options);

// Sums over many steps; reading them waits for the device.
struct DeviceFitSums {
  double squared_error = 0;
  unsigned long long samples = 0;
  unsigned long long rejected_voxels = 0;
};

// The points whose gradients may differ from 0: bit p % 32 of word p / 32 for point p (see
// DeviceGridView). Bits are visited in the voxels' order; a list in the order of touching made
// the step 50 % slower.
struct DeviceTouched {
  DeviceTouched() = default;
  explicit DeviceTouched(const DeviceGrid& grid);
  void MarkAll();
  int64_t num_voxels = 0, num_points = 0;
  DeviceBuffer<uint32_t> bits;
};

// Forward pass, loss and adjoint of a batch on a grid that is being fitted: adds the gradient
// of scale * sum (C - target)^2, including that of background layers (device_sphere_rays.h),
// and of the losses of densities.
// Float sums have no fixed order: two runs differ in the last bits unless exact_sums is set.
class DeviceRayFitter {
 public:
  // Stores every sample of the rays in flight; `max_bytes` bounds the store.
  DeviceRayFitter(const GridFrame& frame, const MarchOptions& options, int64_t max_bytes);
  void Accumulate(const DeviceGrid& grid, const Ray* rays, const Vec3f* targets, int64_t n,
                  float scale, DeviceTouched* touched, const DensityLosses& losses = {});
  DeviceFitSums TakeSums();  // returns the sums and resets them to zero
  DeviceFitSums* sums() { return sums_.data(); }

 private:
  MarchOptions options_;
  int64_t capacity_ = 0;  // samples a ray
  int warps_ = 0;
  DeviceBuffer<float> store_;
  DeviceBuffer<int32_t> next_ray_;
  DeviceBuffer<DeviceFitSums> sums_;
  DeviceBuffer<Vec3f> behind_, d_behind_;  // per ray; empty for a field without layers
};

// weights [N] hold running maxima of w_i over the samples whose cell has the voxel as a corner.
void MaxWeightsOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n,
                        const MarchOptions& options, float* weights);

// Adds the gradient of the total variation (see EQ(total-variation)) of voxels begin, begin +
// 1, ..., begin + count - 1, modulo their number.
void AddTotalVariation(const DeviceGrid& grid, int64_t begin, int64_t count,
                       float scale_density, float scale_sh, DeviceTouched* touched);

// See EQ(rmsprop): steps the touched voxels and resets their gradients.
void StepOnDevice(DeviceGrid* grid, DeviceTouched* touched, const RmspropOptions& options,
                  DeviceFitSums* sums);

}  // namespace regrade
