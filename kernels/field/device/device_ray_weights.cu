#include <algorithm>

#include "kernels/base/device_stream.h"
#include "kernels/field/device/device_ray_weights.h"
#include "kernels/field/device/gradient_view.h"
#include "kernels/field/device/launch.h"
#include "kernels/field/device/warp_item.h"
#include "kernels/field/device/warp_shade.h"

namespace regrade {

DeviceSlots::DeviceSlots(const DeviceGrid& grid)
    : slot_of_voxel(grid.num_voxels(), "slots of voxels"),
      voxel_of_slot(grid.num_voxels(), "voxels of slots"),
      counter(1, "a counter of slots") {}

#if defined(__CUDACC__)

namespace {

// A warp a ray. Samples beyond the list's capacity are counted and not written.
__global__ void MarchWeightsKernel(DeviceGridView grid, const Ray* rays, int64_t n,
                                   MarchOptions options, float min_weight,
                                   DeviceWeightedSample* samples, int64_t capacity,
                                   int32_t* counter, float* transmittance, uint32_t* touched) {
  const int64_t r = (blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x) / 32;
  if (r >= n) return;
  WarpMarch<> march(grid, rays[r], options);
  const int lane = march.lane();
  LaneSample sample;
  unsigned composited;
  while (march.Next(&sample, &composited)) {
    const float w = sample.tau > 0 ? sample.transmittance_before * Opacity(sample.tau) : 0.0f;
    const unsigned kept = __ballot_sync(kAllLanes, w > min_weight);
    if (kept == 0) continue;
    int begin = 0;
    if (lane == 0) begin = atomicAdd(counter, __popc(kept));
    begin = __shfl_sync(kAllLanes, begin, 0);
    if (!(w > min_weight)) continue;
    const int64_t at = begin + __popc(kept & ((1u << lane) - 1));
    if (at >= capacity) continue;
    samples[at] = {sample.cell.vertex, sample.cell.fraction, w, static_cast<int32_t>(r)};
    if (touched == nullptr) continue;
    const NeighbourSteps steps = GridSpace(grid).Steps(sample.cell.vertex);
    for (int k = 0; k < 8; ++k) {
      const int32_t link = grid.links[sample.cell.vertex + steps.To(k)];
      if (link >= 0) Touch(touched, link);
    }
  }
  if (lane == 0) transmittance[r] = expf(-march.optical_depth());
}

// A lane a word of marks; a warp takes its slots at once.
__global__ void AssignSlotsKernel(uint32_t* touched, int64_t words, int32_t* slot_of_voxel,
                                  int32_t* voxel_of_slot, int32_t* counter) {
  const int64_t word = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  const int lane = static_cast<int>(threadIdx.x & 31);
  unsigned marks = word < words ? touched[word] : 0;
  const int count = __popc(marks);
  int before = count;
#pragma unroll
  for (int d = 1; d < 32; d *= 2) {
    const int other = __shfl_up_sync(kAllLanes, before, d);
    if (lane >= d) before += other;
  }
  const int all = __shfl_sync(kAllLanes, before, 31);
  if (all == 0) return;
  int begin = 0;
  if (lane == 0) begin = atomicAdd(counter, all);
  int slot = __shfl_sync(kAllLanes, begin, 0) + before - count;
  if (marks == 0) return;
  touched[word] = 0;
  for (; marks != 0; marks &= marks - 1, ++slot) {
    const int32_t voxel = static_cast<int32_t>(32 * word) + __ffs(marks) - 1;
    slot_of_voxel[voxel] = slot;
    voxel_of_slot[slot] = voxel;
  }
}

// What a warp knows of its sample: lane c * 9 + k stands for coefficient k of channel c, lane j
// < 8 for corner j.
struct WarpSample {
  DeviceWeightedSample sample;
  int lane;
  int32_t slot;  // of this lane's corner; -1 where nothing is stored
  float corner;  // its trilinear weight
  float gamma;   // this lane's basis function along the ray, 0 beyond the field's own

  __device__ WarpSample(const DeviceGridView& grid, int basis, const DeviceWeightedSample& s,
                        const int32_t* slot_of_voxel, const Ray* rays)
      : sample(s), lane(static_cast<int>(threadIdx.x & 31)), slot(-1), corner(0), gamma(0) {
    if (lane < 8) {
      const NeighbourSteps steps = GridSpace(grid).Steps(sample.vertex);
      const int32_t link = grid.links[sample.vertex + steps.To(lane)];
      if (link >= 0) slot = slot_of_voxel[link];
      corner = CornerWeight(sample.fraction, lane);
    }
    if (rays == nullptr) return;
    float all[kMaxBasis];
    ShBasis(kMaxBasis, rays[sample.ray].direction, all);
#pragma unroll
    for (int k = 0; k < kMaxBasis; ++k)
      if (lane < 27 && lane % 9 == k && k < basis) gamma = all[k];
  }

  // This lane's value of the blended row.
  __device__ float Blend(const float* rows) const {
    float value = 0;
#pragma unroll
    for (int k = 0; k < 8; ++k) {
      const int32_t at = __shfl_sync(kAllLanes, slot, k);
      const float w = __shfl_sync(kAllLanes, corner, k);
      if (at >= 0) value += w * rows[int64_t{at} * kRowLanes + lane];
    }
    return value;
  }
};

// Value c * 9 + k in lane order; sums of a channel's nine lanes land on its first one.
__device__ float ChannelSums(float value, int lane) {
  const float ninth = __shfl_down_sync(kAllLanes, value, 8);
  if (lane % 9 == 0) value += ninth;
  value += __shfl_down_sync(kAllLanes, value, 4);
  value += __shfl_down_sync(kAllLanes, value, 2);
  return value + __shfl_down_sync(kAllLanes, value, 1);
}

__global__ void BeginColorsKernel(Vec3f background, const float* transmittance, int64_t n,
                                  Vec3f* color) {
  const int64_t r = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (r < n) color[r] = background * transmittance[r];
}

__global__ void BlendColorsKernel(DeviceGridView grid, int basis,
                                  const DeviceWeightedSample* samples, int64_t n,
                                  const int32_t* counted, const int32_t* slot_of_voxel,
                                  const Ray* rays, const float* rows, Vec3f* color,
                                  uint8_t* open) {
  const int64_t i = ItemOfWarp(n, counted);
  if (i < 0) return;
  const WarpSample warp(grid, basis, samples[i], slot_of_voxel, rays);
  const float sum = ChannelSums(warp.Blend(rows) * warp.gamma, warp.lane);
  const float value = 0.5f + sum;  // of a channel on its first lane
  const bool first = warp.lane < 27 && warp.lane % 9 == 0;
  if (first && value > 0)
    atomicAdd(&color[warp.sample.ray][warp.lane / 9], warp.sample.weight * value);
  const unsigned above = __ballot_sync(kAllLanes, first && value > 0);
  if (warp.lane == 0)
    open[i] =
        static_cast<uint8_t>((above & 1) | (above >> 9 & 1) << 1 | (above >> 18 & 1) << 2);
}

__global__ void BlendColorsAdjointKernel(DeviceGridView grid, int basis,
                                         const DeviceWeightedSample* samples, int64_t n,
                                         const int32_t* counted, const int32_t* slot_of_voxel,
                                         const Ray* rays, const uint8_t* open,
                                         const Vec3f* d_color, float* d_rows) {
  const int64_t i = ItemOfWarp(n, counted);
  if (i < 0) return;
  const unsigned bits = open[i];
  if (bits == 0) return;
  const Vec3f d = d_color[samples[i].ray];
  if (d.x == 0 && d.y == 0 && d.z == 0) return;
  const WarpSample warp(grid, basis, samples[i], slot_of_voxel, rays);
  const int c = warp.lane / 9;
  const float d_blend =
      c < 3 && (bits >> c & 1) != 0 ? warp.sample.weight * d[c < 3 ? c : 0] * warp.gamma : 0.0f;
#pragma unroll
  for (int k = 0; k < 8; ++k) {
    const int32_t at = __shfl_sync(kAllLanes, warp.slot, k);
    const float w = __shfl_sync(kAllLanes, warp.corner, k);
    if (at >= 0 && d_blend != 0)
      atomicAdd(&d_rows[int64_t{at} * kRowLanes + warp.lane], w * d_blend);
  }
}

__global__ void BlendRowsKernel(DeviceGridView grid, const DeviceWeightedSample* samples,
                                int64_t n, const int32_t* counted, const int32_t* slot_of_voxel,
                                const float* rows, float* sums) {
  const int64_t i = ItemOfWarp(n, counted);
  if (i < 0) return;
  const WarpSample warp(grid, 1, samples[i], slot_of_voxel, nullptr);
  atomicAdd(&sums[int64_t{warp.sample.ray} * kRowLanes + warp.lane],
            warp.sample.weight * warp.Blend(rows));
}

// What does not fit is not worked on: the step is made again with more room.
__global__ void LimitToRoomKernel(int64_t sample_room, int64_t slot_room, int32_t* samples,
                                  int32_t* slots, DeviceRoom* room) {
  room->samples = *samples;
  room->slots = *slots;
  if (*samples <= sample_room && *slots <= slot_room) return;
  room->short_of = 1;
  *samples = *slots = 0;
}

}  // namespace

void DeviceRayWeights::Reserve(int64_t rays, int64_t most_samples) {
  if (counter.empty()) counter = DeviceBuffer<int32_t>(1, "a counter of samples");
  if (samples.size() < most_samples) {
    samples = {};
    samples = DeviceBuffer<DeviceWeightedSample>(most_samples, "samples of rays");
  }
  if (transmittance.size() < rays)
    transmittance = DeviceBuffer<float>(rays, "transmittances of rays");
}

void DeviceRayWeights::Launch(const DeviceGrid& grid, const Ray* rays, int64_t n,
                              const MarchOptions& options, float min_weight,
                              DeviceTouched* touched) {
  num_rays = n;
  num_samples = samples.size();
  counter.Zero();
  MarchWeightsKernel<<<BlocksFor(32 * n), kThreads, 0, LaunchStream()>>>(
      grid.view(), rays, n, options, min_weight, samples.data(), samples.size(), counter.data(),
      transmittance.data(), touched != nullptr ? touched->bits.data() : nullptr);
  CheckLaunch("march_weights");
}

void DeviceRayWeights::March(const DeviceGrid& grid, const Ray* rays, int64_t n,
                             const MarchOptions& options, float min_weight,
                             DeviceTouched* touched) {
  constexpr int64_t kFewest = 1 << 20;  // samples there is room for from the start
  Reserve(n, kFewest);
  num_rays = n;
  num_samples = 0;
  while (n > 0) {
    Launch(grid, rays, n, options, min_weight, touched);
    int32_t count = 0;
    counter.CopyOut(&count, 1);
    num_samples = count;
    if (num_samples <= samples.size()) break;
    Reserve(n, num_samples + num_samples / 4);
  }
}

void DeviceSlots::Launch(DeviceTouched* touched) {
  counter.Zero();
  const int64_t words = touched->bits.size();
  AssignSlotsKernel<<<BlocksFor(words), kThreads, 0, LaunchStream()>>>(
      touched->bits.data(), words, slot_of_voxel.data(), voxel_of_slot.data(), counter.data());
  CheckLaunch("assign_slots");
}

void DeviceSlots::Assign(DeviceTouched* touched) {
  Launch(touched);
  int32_t count = 0;
  counter.CopyOut(&count, 1);
  num_slots = count;
}

void LimitToRoom(int64_t slot_room, DeviceRayWeights* weights, DeviceSlots* slots,
                 DeviceRoom* room) {
  slots->num_slots = slot_room;
  LimitToRoomKernel<<<1, 1, 0, LaunchStream()>>>(
      weights->samples.size(), slot_room, weights->counter.data(), slots->counter.data(), room);
  CheckLaunch("limit_to_room");
}

void BlendColors(const DeviceGrid& grid, const DeviceRayWeights& weights,
                 const DeviceSlots& slots, const Ray* rays, const float* rows, Vec3f* color,
                 uint8_t* open) {
  if (weights.num_rays == 0) return;
  BeginColorsKernel<<<BlocksFor(weights.num_rays), kThreads, 0, LaunchStream()>>>(
      grid.background, weights.transmittance.data(), weights.num_rays, color);
  CheckLaunch("begin_colors");
  if (weights.num_samples == 0) return;
  BlendColorsKernel<<<BlocksFor(32 * weights.num_samples), kThreads, 0, LaunchStream()>>>(
      grid.view(), grid.basis, weights.samples.data(), weights.num_samples,
      weights.counter.data(), slots.slot_of_voxel.data(), rays, rows, color, open);
  CheckLaunch("blend_colors");
}

void BlendColorsAdjoint(const DeviceGrid& grid, const DeviceRayWeights& weights,
                        const DeviceSlots& slots, const Ray* rays, const uint8_t* open,
                        const Vec3f* d_color, float* d_rows) {
  if (weights.num_samples == 0) return;
  BlendColorsAdjointKernel<<<BlocksFor(32 * weights.num_samples), kThreads, 0,
                             LaunchStream()>>>(
      grid.view(), grid.basis, weights.samples.data(), weights.num_samples,
      weights.counter.data(), slots.slot_of_voxel.data(), rays, open, d_color, d_rows);
  CheckLaunch("blend_colors_adjoint");
}

void BlendRows(const DeviceGrid& grid, const DeviceRayWeights& weights,
               const DeviceSlots& slots, const float* rows, float* sums) {
  DeviceZero(sums, weights.num_rays * kRowLanes * int64_t{sizeof(float)});
  if (weights.num_samples == 0) return;
  BlendRowsKernel<<<BlocksFor(32 * weights.num_samples), kThreads, 0, LaunchStream()>>>(
      grid.view(), weights.samples.data(), weights.num_samples, weights.counter.data(),
      slots.slot_of_voxel.data(), rows, sums);
  CheckLaunch("blend_rows");
}

#else

void DeviceRayWeights::March(const DeviceGrid&, const Ray*, int64_t, const MarchOptions&, float,
                             DeviceTouched*) {
  DeviceWait("march_weights");
}
void DeviceRayWeights::Reserve(int64_t, int64_t) { DeviceWait("march_weights"); }
void DeviceRayWeights::Launch(const DeviceGrid&, const Ray*, int64_t, const MarchOptions&,
                              float, DeviceTouched*) {
  DeviceWait("march_weights");
}
void DeviceSlots::Launch(DeviceTouched*) { DeviceWait("assign_slots"); }
void DeviceSlots::Assign(DeviceTouched*) { DeviceWait("assign_slots"); }
void LimitToRoom(int64_t, DeviceRayWeights*, DeviceSlots*, DeviceRoom*) {
  DeviceWait("limit_to_room");
}
void BlendColors(const DeviceGrid&, const DeviceRayWeights&, const DeviceSlots&, const Ray*,
                 const float*, Vec3f*, uint8_t*) {
  DeviceWait("blend_colors");
}
void BlendColorsAdjoint(const DeviceGrid&, const DeviceRayWeights&, const DeviceSlots&,
                        const Ray*, const uint8_t*, const Vec3f*, float*) {
  DeviceWait("blend_colors_adjoint");
}
void BlendRows(const DeviceGrid&, const DeviceRayWeights&, const DeviceSlots&, const float*,
               float*) {
  DeviceWait("blend_rows");
}

#endif

}  // namespace regrade
