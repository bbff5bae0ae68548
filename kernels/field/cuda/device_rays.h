// Rays through a field on a CUDA device: rendering, fitting's forward and adjoint in one
// kernel, and the largest weights. Held to render_ray.h by the parity table. A warp walks a
// ray; its lanes first look at 32 samples at a time, then stand for the values of a voxel.
#pragma once

#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/cuda/half_grid.h"
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
// EQ(opacity-steps): a ray's colour is the integral of the colour along it over what it has
// lost of its light,
//   C = int_0^{1 - T} c(o) do + T c_bg,   o = 1 - (what is left of the light),
// and the sum over samples is that integral with c constant between them. With opacity_step s >
// 0 only the samples at which o passes (k + 1/2) s are looked at, each stands for all that was
// lost since the one before, and the sum is scaled to what was lost in all: at most 1 / s + 1
// colours a ray, and an error of about s times the change of colour within a step; a ray that
// loses less than s / 2 loses it to nothing. 0 looks at every sample. Depths and transmittances
// are exact either way.
void RenderOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n,
                    const MarchOptions& options, const DeviceRenderTarget& target,
                    float opacity_step = 0);

// A frame at a camera without distortion: its rays are made where they are followed, and pixels
// are finished there (see FinishPixel). `target` [height, width]; does not wait. `half`, if it
// is given and not empty, stands in for the grid's own colours and densities.
void RenderFrameOnDevice(const DeviceGrid& grid, const Camera& camera,
                         const MarchOptions& options, const DeviceRenderTarget& target,
                         float opacity_step = 0, const HalfGrid* half = nullptr);

// A whole view, colours clipped and depths along the optical axis; see render.h.
RenderedView RenderViewOnDevice(const DeviceGrid& grid, const Camera& camera,
                                const MarchOptions& options, float opacity_step = 0,
                                const HalfGrid* half = nullptr);

// Sums over many steps; read them seldom, reading waits for the device.
struct DeviceFitSums {
  double squared_error = 0;
  unsigned long long samples = 0;
  unsigned long long rejected_voxels = 0;
};

// Which points' gradients may differ from 0: bit p % 32 of word p / 32 for point p (see
// DeviceGridView). Bits are walked in the voxels' order; a list in the order of touching made
// the step half as slow again.
struct DeviceTouched {
  DeviceTouched() = default;
  explicit DeviceTouched(const DeviceGrid& grid);
  void MarkAll();
  int64_t num_voxels = 0, num_points = 0;
  DeviceBuffer<uint32_t> bits;
};

// Forward, loss and adjoint of a batch on a grid that is being fitted: adds the gradient of
// scale * sum (C - target)^2, of background layers, too (see device_sphere_rays.h). Float sums
// in no fixed order: two runs differ in the last bits.
class DeviceRayFitter {
 public:
  // Keeps every sample of the rays in flight; `max_bytes` bounds that store.
  DeviceRayFitter(const GridFrame& frame, const MarchOptions& options, int64_t max_bytes);
  void Accumulate(const DeviceGrid& grid, const Ray* rays, const Vec3f* targets, int64_t n,
                  float scale, DeviceTouched* touched);
  DeviceFitSums TakeSums();  // and sets them to zero
  DeviceFitSums* sums() { return sums_.data(); }

 private:
  MarchOptions options_;
  int64_t capacity_ = 0;  // samples a ray
  int warps_ = 0;
  DeviceBuffer<float> store_;
  DeviceBuffer<int32_t> next_ray_;
  DeviceBuffer<DeviceFitSums> sums_;
  DeviceBuffer<Vec3f> behind_, d_behind_;  // of rays; nothing where a field has no layers
};

// weights [N] hold running maxima of w_i over the samples whose cell has the voxel as a corner.
void MaxWeightsOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n,
                        const MarchOptions& options, float* weights);

// Adds the gradient of the total variation (see EQ(total-variation)) of voxels begin, begin +
// 1, ..., begin + count - 1, modulo their number.
void AddTotalVariation(const DeviceGrid& grid, int64_t begin, int64_t count,
                       float scale_density, float scale_sh, DeviceTouched* touched);

// See EQ(rmsprop): steps the touched voxels and forgets their gradients.
void StepOnDevice(DeviceGrid* grid, DeviceTouched* touched, const RmspropOptions& options,
                  DeviceFitSums* sums);

}  // namespace regrade
