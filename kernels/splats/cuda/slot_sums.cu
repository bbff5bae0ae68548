#include "kernels/device/device_stream.h"
#include "kernels/splats/cuda/device_math.h"
#include "kernels/splats/cuda/slot_sums.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

constexpr int kBlock = 128;      // threads
constexpr int kManyTiles = 128;  // a warp shares the work for splats with more
constexpr int kStaged = 64;      // slots that a warp has in shared memory at a time

struct Total {
  double value[10] = {};

  __device__ void Add(const SlotSums& slot) {
    for (int a = 0; a < 2; ++a) value[a] += slot.h[a];
    for (int a = 0; a < 3; ++a) value[2 + a] += slot.H[a];
    value[5] += slot.f;
    for (int c = 0; c < 3; ++c) value[6 + c] += slot.color[c];
    value[9] += slot.z;
  }
  // Of all lanes' totals, in a fixed order.
  __device__ void AddLanes() {
    for (double& v : value)
      for (int step = 16; step > 0; step /= 2) v += __shfl_xor_sync(kWholeWarp, v, step);
  }
  __device__ SlotSums Rounded() const {
    float f[10];
    for (int a = 0; a < 10; ++a) f[a] = static_cast<float>(value[a]);
    return {{f[0], f[1]}, {f[2], f[3], f[4]}, f[5], {f[6], f[7], f[8]}, f[9], 0};
  }
};

// Copies slots [first, end) to shared memory, by a warp.
__device__ void Stage(const SlotSums* sums, int first, int end, int lane, float4* staged) {
  constexpr int kParts = sizeof(SlotSums) / sizeof(float4);
  const float4* const from = reinterpret_cast<const float4*>(sums + first);
  float4 part[kStaged * kParts / 32];
#pragma unroll
  for (int j = 0; j < kStaged * kParts / 32; ++j) {
    const int at = lane + 32 * j;
    if (at < (end - first) * kParts) part[j] = from[at];
  }
  __syncwarp();  // the slots before have been added
#pragma unroll
  for (int j = 0; j < kStaged * kParts / 32; ++j) staged[lane + 32 * j] = part[j];
  __syncwarp();
}

// By a warp, lane by lane.
__device__ void SumMany(SlotSums* sums, int first, int end, uint32_t stamp, int lane) {
  Total total;
  for (int s = first + lane; s < end; s += 32)
    if (sums[s].stamp == stamp) total.Add(sums[s]);
  total.AddLanes();
  if (lane == 0) sums[first] = total.Rounded();
}

// A thread for each splat in order: the slots of a warp's splats are consecutive.
__global__ void __launch_bounds__(kBlock)
    Sum(const int32_t* order, const int32_t* num_tiles, const int32_t* first_slot,
        int64_t count, uint32_t stamp, SlotSums* sums) {
  __shared__ float4 shared[kBlock / 32][kStaged * sizeof(SlotSums) / sizeof(float4)];
  const int lane = static_cast<int>(threadIdx.x % 32);
  float4* const staged = shared[threadIdx.x / 32];
  const int64_t k = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  const int32_t i = k < count ? order[k] : 0;
  const int tiles = k < count ? num_tiles[i] : 0;
  const int first = tiles > 0 ? first_slot[i] : 0, end = first + tiles;
  if (__shfl_sync(kWholeWarp, tiles, 0) == 0) return;  // and none after it
  const unsigned many = __ballot_sync(kWholeWarp, tiles > kManyTiles);
  // Runs of splats that are not many-tiled are staged together.
  for (unsigned left = __ballot_sync(kWholeWarp, tiles > 0); left != 0;) {
    const int begin_lane = __ffs(static_cast<int>(left)) - 1;
    const int from = __shfl_sync(kWholeWarp, first, begin_lane);
    if (many >> begin_lane & 1) {
      SumMany(sums, from, __shfl_sync(kWholeWarp, end, begin_lane), stamp, lane);
      left &= left - 1;
      continue;
    }
    const unsigned stops = (many | ~left) & ~((2u << begin_lane) - 1);
    const int end_lane = stops != 0 ? __ffs(static_cast<int>(stops)) - 1 : 32;
    const int to = __shfl_sync(kWholeWarp, end, end_lane - 1);
    const bool mine = lane >= begin_lane && lane < end_lane;
    Total total;
    for (int base = from; base < to; base += kStaged) {
      const int stop = min(base + kStaged, to);
      Stage(sums, base, stop, lane, staged);
      if (!mine) continue;
      const SlotSums* const slots = reinterpret_cast<const SlotSums*>(staged);
      for (int s = max(first, base); s < min(end, stop); ++s)
        if (slots[s - base].stamp == stamp) total.Add(slots[s - base]);
    }
    __syncwarp();
    if (mine) sums[first] = total.Rounded();
    left &= end_lane < 32 ? ~((1u << end_lane) - 1) : 0;
  }
}

}  // namespace

void SumSlots(const int32_t* order, const int32_t* num_tiles, const int32_t* first_slot,
              int64_t count, uint32_t stamp, SlotSums* sums) {
  if (count == 0) return;
  Sum<<<static_cast<unsigned>((count + kBlock - 1) / kBlock), kBlock, 0, LaunchStream()>>>(
      order, num_tiles, first_slot, count, stamp, sums);
  CheckLaunch("sum_slots");
}

#else

void SumSlots(const int32_t*, const int32_t*, const int32_t*, int64_t, uint32_t, SlotSums*) {
  DeviceWait("splats");
}

#endif

}  // namespace regrade
