// Sample weights of rays on a CUDA device, and colours blended from rows of the points that
// they touch: ray_weights.h and LipRF's second stage there. Samples of many rays lie in one
// list in no fixed order, each with its ray.
#pragma once

#include <cstdint>

#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/cuda/device_rays.h"
#include "stylize/cuda/device_rows.h"
#include "stylize/cuda/device_style_field.h"

namespace regrade {

// As WeightedSample.
struct DeviceWeightedSample {
  int32_t vertex;  // lowest corner of the cell; negative on a background sphere; or a splat
  Vec3f fraction;  // within the cell; of a splat, the direction from the camera to it
  float weight;
  int32_t ray;
};

// The samples of a batch of rays that weigh more than min_weight, and which voxels they touch.
// Those of splats are not marched, see TakeSamples.
struct DeviceRayWeights {
  DeviceBuffer<DeviceWeightedSample> samples;
  DeviceBuffer<float> transmittance;  // [rays]
  DeviceBuffer<int32_t> counter;
  int64_t num_rays = 0, num_samples = 0;

  // Waits for the device, for the number of samples decides what comes next. Marks are added to
  // `touched` unless it is null.
  void March(const DeviceGrid& grid, const Ray* rays, int64_t n, const MarchOptions& options,
             float min_weight, DeviceTouched* touched);

  // The same without waiting, in the room that Reserve has made: num_samples is that room, and
  // how many samples there are stays in `counter`, which may pass it.
  void Reserve(int64_t rays, int64_t most_samples);
  void Launch(const DeviceGrid& grid, const Ray* rays, int64_t n, const MarchOptions& options,
              float min_weight, DeviceTouched* touched);
};

// Touched points (see DeviceGridView) in a dense list, in their order.
struct DeviceSlots {
  DeviceBuffer<int32_t> slot_of_point;  // only touched points' entries mean anything
  DeviceBuffer<int32_t> point_of_slot;  // the first num_slots of it
  DeviceBuffer<int32_t> counter;
  DeviceBuffer<int32_t> first_of_word;  // slots before each word of marks
  DeviceBuffer<uint8_t> scan_scratch;
  int64_t num_slots = 0;

  explicit DeviceSlots(const DeviceGrid& grid);
  void Assign(DeviceTouched* touched);  // and forgets the marks; waits for the device
  void Launch(DeviceTouched* touched);  // the same without waiting: num_slots is not known
};

// What a step that the host does not watch asked for, and whether there was room.
struct BufferDemand {
  int32_t samples = 0, slots = 0;
  int32_t overflowed = 0;  // 1 from the first step on that did not fit
};
// Behind the two Launch: num_slots becomes `slot_capacity`. Where samples or slots have no room
// all of them are dropped, and *room, which lies on the device, says so.
void ClampToCapacity(int64_t slot_capacity, DeviceRayWeights* weights, DeviceSlots* slots,
                     BufferDemand* room);

// Sums over samples, whose order differs from run to run. `exact`, here and below, is null for
// float sums, or room on the device for twice as many floats as the result has: values are then
// summed there as integers (AddExact in gradient_view.h), and the result is the same in any
// order.

// The colours of rays whose points have the rows of `slots` instead of their own: color [rays]
// begins with the background and is not clipped at 1. unclamped [samples]: bit c is set where
// the clamp at 0 left channel c alone.
void BlendColors(const DeviceStyleField& field, const DeviceRayWeights& weights,
                 const DeviceSlots& slots, const Ray* rays, const float* rows, Vec3f* color,
                 uint8_t* unclamped, float* exact);
// Its adjoint: adds to d_rows [slots, stride of field.row()], the masses of EQ(view-penalty)
// among them. With `exact` it adds to that, and d_rows is what has been added since it was
// zero.
void BlendColorsAdjoint(const DeviceStyleField& field, const DeviceRayWeights& weights,
                        const DeviceSlots& slots, const Ray* rays, const uint8_t* unclamped,
                        const Vec3f* d_color, float* d_rows, float* exact);
// sums [rays, stride] = sum_i w_i of the blended rows themselves.
void BlendRows(const DeviceStyleField& field, const DeviceRayWeights& weights,
               const DeviceSlots& slots, const float* rows, float* sums, float* exact);

}  // namespace regrade
