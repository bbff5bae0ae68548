// Sample weights of rays on a CUDA device, and colours blended from rows of the voxels that
// they touch: ray_weights.h and LipRF's second stage there. Samples of many rays lie in one
// list in no fixed order, each with its ray.
#pragma once

#include <cstdint>

#include "kernels/field/device/device_grid.h"
#include "kernels/field/device/device_rays.h"

namespace regrade {

struct DeviceWeightedSample {
  int32_t vertex;  // lowest corner of the cell
  Vec3f fraction;
  float weight;
  int32_t ray;
};

// The samples of a batch of rays that weigh more than min_weight, and which voxels they touch.
struct DeviceRayWeights {
  DeviceBuffer<DeviceWeightedSample> samples;
  DeviceBuffer<float> transmittance;  // [rays]
  DeviceBuffer<int32_t> counter;
  int64_t num_rays = 0, num_samples = 0;

  // Waits for the device, for the number of samples decides what comes next. Marks are added to
  // `touched` unless it is null.
  void March(const DeviceGrid& grid, const Ray* rays, int64_t n, const MarchOptions& options,
             float min_weight, DeviceTouched* touched);
};

// Touched voxels in a dense list, near each other where the voxels are.
struct DeviceSlots {
  DeviceBuffer<int32_t> slot_of_voxel;  // [N]; only touched voxels' entries mean anything
  DeviceBuffer<int32_t> voxel_of_slot;  // [N], the first num_slots of it
  DeviceBuffer<int32_t> counter;
  int64_t num_slots = 0;

  explicit DeviceSlots(const DeviceGrid& grid);
  void Assign(DeviceTouched* touched);  // and forgets the marks; waits for the device
};

inline constexpr int kRowLanes =
    32;  // floats of a voxel's row: three channels of nine coefficients, and five more

// rows [n, kRowLanes]: coefficients padded to nine a channel, the place of the voxel in the box
// times position_scale (see FillFeatures in stylize/lipschitz_network.h), zeros. voxels [n], or
// null for first, first + 1, ...
void GatherRows(const DeviceGrid& grid, const int32_t* voxels, int64_t first, int64_t n,
                float position_scale, float* rows);
// rows += (matrix (x) I_9) from, and `constant` on each channel's first coefficient. [n,
// kRowLanes]
void AddMappedRows(const Mat3f& matrix, const Vec3f& constant, const float* from, int64_t n,
                   float* rows);
// The field's own colours from rows [n, kRowLanes] of voxels first, first + 1, ...
void ScatterRows(const float* rows, int64_t first, int64_t n, DeviceGrid* grid);

// The colours of rays whose voxels have the rows of `slots` instead of their own: color [rays]
// begins with the background and is not clipped at 1. open [samples]: bit c is set where the
// clamp at 0 left channel c alone.
void BlendColors(const DeviceGrid& grid, const DeviceRayWeights& weights,
                 const DeviceSlots& slots, const Ray* rays, const float* rows, Vec3f* color,
                 uint8_t* open);
// Its adjoint: adds to d_rows [slots, kRowLanes].
void BlendColorsAdjoint(const DeviceGrid& grid, const DeviceRayWeights& weights,
                        const DeviceSlots& slots, const Ray* rays, const uint8_t* open,
                        const Vec3f* d_color, float* d_rows);
// sums [rays, kRowLanes] = sum_i w_i of the blended rows themselves.
void BlendRows(const DeviceGrid& grid, const DeviceRayWeights& weights,
               const DeviceSlots& slots, const float* rows, float* sums);

}  // namespace regrade
