// The samples of rays and the points that they touch.
#include <algorithm>

#include "kernels/device/device_stream.h"
#include "kernels/field/cuda/gradient_view.h"
#include "kernels/field/cuda/launch.h"
#include "kernels/field/cuda/warp_layers.h"
#include "stylize/cuda/device_ray_weights.h"

#if defined(__CUDACC__)
#include <cub/device/device_scan.cuh>
#endif

namespace regrade {

#if defined(__CUDACC__)

namespace {

// The number of marks before each word, in place of its own.
void SumBefore(int64_t words, int32_t* counts, void* scratch, size_t* scratch_bytes) {
  cub::DeviceScan::ExclusiveSum(scratch, *scratch_bytes, counts, counts,
                                static_cast<int>(words), LaunchStream());
}

// Where samples go: those beyond the list's capacity are counted and not written.
struct SampleList {
  DeviceWeightedSample* samples;
  int64_t capacity;
  int32_t* counter;

  // For all lanes of a warp at once: the place of a lane that keeps its sample, or -1.
  __device__ int64_t Place(bool keeps, int lane) const {
    const unsigned kept = __ballot_sync(kAllLanes, keeps);
    if (kept == 0) return -1;
    int begin = 0;
    if (lane == 0) begin = atomicAdd(counter, __popc(kept));
    begin = __shfl_sync(kAllLanes, begin, 0);
    const int64_t at = begin + __popc(kept & ((1u << lane) - 1));
    return keeps && at < capacity ? at : -1;
  }
};

// A warp a ray.
__global__ void MarchWeightsKernel(DeviceGridView grid, const Ray* rays, int64_t n,
                                   MarchOptions options, float min_weight, SampleList list,
                                   float* transmittance, uint32_t* touched) {
  const int64_t r = (blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x) / 32;
  if (r >= n) return;
  WarpMarch<> march(grid, rays[r], options);
  const int lane = march.lane();
  LaneSample sample;
  unsigned composited;
  while (march.Next(&sample, &composited)) {
    const float w = sample.tau > 0 ? sample.transmittance_before * Opacity(sample.tau) : 0.0f;
    const int64_t at = list.Place(w > min_weight, lane);
    if (at < 0) continue;
    list.samples[at] = {sample.cell.vertex, sample.cell.fraction, w, static_cast<int32_t>(r)};
    if (touched == nullptr) continue;
    const NeighbourSteps steps = GridSampler(grid).Steps(sample.cell.vertex);
    for (int k = 0; k < 8; ++k) {
      const int32_t link = grid.links[sample.cell.vertex + steps.To(k)];
      if (link >= 0) Touch(touched, link);
    }
  }
  if (lane == 0) transmittance[r] = expf(-march.optical_depth());
}

// Goes on behind the box.
__global__ void MarchSpheresKernel(DeviceGridView grid, const Ray* rays, int64_t n, float stop,
                                   float min_weight, SampleList list, float* transmittance,
                                   uint32_t* touched) {
  const int64_t r = (blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x) / 32;
  if (r >= n) return;
  const DeviceSpheresView& spheres = grid.spheres;
  WarpLayers layers(grid, rays[r], transmittance[r], stop);
  LaneLayer mine;
  unsigned composited;
  while (layers.Next(&mine, &composited)) {
    const float w = mine.tau > 0 ? mine.Weight() : 0.0f;
    const int64_t at = list.Place(w > min_weight, layers.lane());
    if (at < 0) continue;
    const TexelCell<float>& cell = mine.cell;
    list.samples[at] = {~(cell.texel[0] * spheres.layers + mine.layer),
                        {cell.weight[2] + cell.weight[3], cell.weight[1] + cell.weight[3], 0},
                        w,
                        static_cast<int32_t>(r)};
    if (touched == nullptr) continue;
    for (const int32_t texel : cell.texel) {
      const int32_t column = spheres.links[texel];
      if (column >= 0)
        Touch(touched, grid.first_texel() + column * spheres.layers + mine.layer);
    }
  }
  if (layers.lane() == 0) transmittance[r] = layers.transmittance();
}

__global__ void CountMarksKernel(const uint32_t* touched, int64_t words, int32_t* counts) {
  const int64_t word = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (word < words) counts[word] = __popc(touched[word]);
}

// A thread a word of marks.
__global__ void AssignSlotsKernel(uint32_t* touched, int64_t words,
                                  const int32_t* first_of_word, int32_t* slot_of_point,
                                  int32_t* point_of_slot, int32_t* counter) {
  const int64_t word = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (word >= words) return;
  unsigned marks = touched[word];
  int slot = first_of_word[word];
  if (word + 1 == words) *counter = slot + __popc(marks);
  if (marks == 0) return;
  touched[word] = 0;
  for (; marks != 0; marks &= marks - 1, ++slot) {
    const int32_t point = static_cast<int32_t>(32 * word) + __ffs(marks) - 1;
    slot_of_point[point] = slot;
    point_of_slot[slot] = point;
  }
}

// What does not fit is not worked on: the step is made again with more room.
__global__ void ClampToCapacityKernel(int64_t sample_capacity, int64_t slot_capacity,
                                      int32_t* samples, int32_t* slots, BufferDemand* room) {
  room->samples = *samples;
  room->slots = *slots;
  if (*samples <= sample_capacity && *slots <= slot_capacity) return;
  room->overflowed = 1;
  *samples = *slots = 0;
}

}  // namespace

DeviceSlots::DeviceSlots(const DeviceGrid& grid)
    : slot_of_point(grid.num_points(), "slots of voxels"),
      point_of_slot(grid.num_points(), "voxels of slots"),
      counter(1, "a counter of slots"),
      first_of_word((grid.num_points() + 31) / 32, "slots before words") {
  size_t bytes = 0;
  SumBefore(first_of_word.size(), first_of_word.data(), nullptr, &bytes);
  scan_scratch = DeviceBuffer<uint8_t>(static_cast<int64_t>(bytes), "scratch of a scan");
}

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
  const SampleList list{samples.data(), samples.size(), counter.data()};
  uint32_t* const marks = touched != nullptr ? touched->bits.data() : nullptr;
  MarchWeightsKernel<<<BlocksFor(32 * n), kThreads, 0, LaunchStream()>>>(
      grid.view(), rays, n, options, min_weight, list, transmittance.data(), marks);
  CheckLaunch("march_weights");
  if (!grid.spheres.on()) return;
  MarchSpheresKernel<<<BlocksFor(32 * n), kThreads, 0, LaunchStream()>>>(
      grid.view(), rays, n, options.stop_transmittance, min_weight, list, transmittance.data(),
      marks);
  CheckLaunch("march_spheres");
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
  const int64_t words = touched->bits.size();
  uint32_t* const marks = touched->bits.data();
  CountMarksKernel<<<BlocksFor(words), kThreads, 0, LaunchStream()>>>(marks, words,
                                                                      first_of_word.data());
  CheckLaunch("count_marks");
  size_t bytes = static_cast<size_t>(scan_scratch.size());
  SumBefore(words, first_of_word.data(), scan_scratch.data(), &bytes);
  CheckLaunch("scan_marks");
  AssignSlotsKernel<<<BlocksFor(words), kThreads, 0, LaunchStream()>>>(
      marks, words, first_of_word.data(), slot_of_point.data(), point_of_slot.data(),
      counter.data());
  CheckLaunch("assign_slots");
}

void DeviceSlots::Assign(DeviceTouched* touched) {
  Launch(touched);
  int32_t count = 0;
  counter.CopyOut(&count, 1);
  num_slots = count;
}

void ClampToCapacity(int64_t slot_capacity, DeviceRayWeights* weights, DeviceSlots* slots,
                     BufferDemand* room) {
  slots->num_slots = slot_capacity;
  ClampToCapacityKernel<<<1, 1, 0, LaunchStream()>>>(weights->samples.size(), slot_capacity,
                                                     weights->counter.data(),
                                                     slots->counter.data(), room);
  CheckLaunch("clamp_to_capacity");
}

#else

DeviceSlots::DeviceSlots(const DeviceGrid&) { DeviceWait("assign_slots"); }
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
void ClampToCapacity(int64_t, DeviceRayWeights*, DeviceSlots*, BufferDemand*) {
  DeviceWait("clamp_to_capacity");
}

#endif

}  // namespace regrade
