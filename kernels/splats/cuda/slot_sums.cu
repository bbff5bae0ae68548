#include "kernels/splats/cuda/slot_sums.h"

#include "kernels/device/device_stream.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

constexpr unsigned kAll = 0xFFFFFFFF;
constexpr int kBlock = 128;     // threads
constexpr int kManyTiles = 48;  // a warp shares the work for splats with more

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
      for (int step = 16; step > 0; step /= 2) v += __shfl_xor_sync(kAll, v, step);
  }
  __device__ SlotSums Rounded() const {
    float f[10];
    for (int a = 0; a < 10; ++a) f[a] = static_cast<float>(value[a]);
    return {{f[0], f[1]}, {f[2], f[3], f[4]}, f[5], {f[6], f[7], f[8]}, f[9], 0};
  }
};

// The sum of every `step`-th slot from `first` on, as far as they are marked.
__device__ Total SumOf(const SlotSums* sums, int first, int end, int step, uint32_t stamp) {
  Total total;
#pragma unroll 4
  for (int s = first; s < end; s += step) {
    SlotSums slot = sums[s];
    if (slot.stamp != stamp) slot = {};
    total.Add(slot);
  }
  return total;
}

// A thread for each splat in order.
__global__ void __launch_bounds__(kBlock)
    Sum(const int32_t* order, const int32_t* num_tiles, const int32_t* first_slot,
        int64_t count, uint32_t stamp, SlotSums* sums) {
  const int64_t k = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  const int32_t i = k < count ? order[k] : 0;
  const int tiles = k < count ? num_tiles[i] : 0;
  const int first = tiles > 0 ? first_slot[i] : 0;
  if (tiles > 0 && tiles <= kManyTiles)
    sums[first] = SumOf(sums, first, first + tiles, 1, stamp).Rounded();
  for (unsigned many = __ballot_sync(kAll, tiles > kManyTiles); many != 0; many &= many - 1) {
    const int source = __ffs(static_cast<int>(many)) - 1;
    const int from = __shfl_sync(kAll, first, source);
    const int end = from + __shfl_sync(kAll, tiles, source);
    const int lane = static_cast<int>(threadIdx.x % 32);
    Total total = SumOf(sums, from + lane, end, 32, stamp);
    total.AddLanes();
    if (lane == source) sums[from] = total.Rounded();
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
