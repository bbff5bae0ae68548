#include "kernels/splats/cuda/slot_sums.h"

#include "kernels/device/device_stream.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

constexpr unsigned kAll = 0xFFFFFFFF;
constexpr int kBlock = 128;     // threads
constexpr int kManyTiles = 48;  // at most 64; a warp shares the work for splats with more

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
    return {{f[0], f[1]}, {f[2], f[3], f[4]}, f[5], {f[6], f[7], f[8]}, f[9]};
  }
};

// Of a thread's splat with at most kManyTiles. Which slots were written is found first, so that
// loads of several slots overlap.
__device__ Total SumOfFew(const SlotsOfSplats& slots, int32_t i, int tiles) {
  const SplatRecord record = slots.record[i];
  const uint64_t order = OrderOf(__float_as_uint(record.z), i);
  const SlotSums* const first = slots.sums + slots.first_slot[i];
  uint64_t written = 0;
  SplatTiles(record, slots.grid).ForAll([&](int tile, int place) {
    if (order <= slots.last[tile]) written |= uint64_t{1} << place;
  });
  Total total;
#pragma unroll 4
  for (int place = 0; place < tiles; ++place) {
    const bool on = written >> place & 1;
    SlotSums slot{};
    if (on) slot = first[place];
    total.Add(slot);
  }
  return total;
}

// Calls for_tiles(add), with add(tile, place) for the tiles of splat i.
template <typename ForTiles>
__device__ Total SumOf(const SlotsOfSplats& slots, int32_t i, const SplatRecord& record,
                       const ForTiles& for_tiles) {
  const uint64_t order = OrderOf(__float_as_uint(record.z), i);
  const SlotSums* const first = slots.sums + slots.first_slot[i];
  Total total;
  for_tiles([&](int tile, int place) {
    if (order <= slots.last[tile]) total.Add(first[place]);
  });
  return total;
}

// A thread for each splat in order.
__global__ void __launch_bounds__(kBlock) Sum(SlotsOfSplats slots, int64_t count) {
  const int64_t k = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  const int32_t i = k < count ? slots.order[k] : 0;
  const int tiles = k < count ? slots.num_tiles[i] : 0;
  if (tiles > 0 && tiles <= kManyTiles) {
    const Total total = SumOfFew(slots, i, tiles);
    slots.sums[slots.first_slot[i]] = total.Rounded();
  }
  for (unsigned many = __ballot_sync(kAll, tiles > kManyTiles); many != 0; many &= many - 1) {
    const int lane = __ffs(static_cast<int>(many)) - 1;
    const int32_t shared = __shfl_sync(kAll, i, lane);
    const SplatRecord record = slots.record[shared];
    Total total = SumOf(slots, shared, record, [&](const auto& add) {
      SplatTiles(record, slots.grid).ForAllByWarp(add);
    });
    total.AddLanes();
    if (static_cast<int>(threadIdx.x % 32) == lane)
      slots.sums[slots.first_slot[shared]] = total.Rounded();
  }
}

}  // namespace

void SumSlots(const SlotsOfSplats& slots, int64_t count) {
  if (count == 0) return;
  Sum<<<static_cast<unsigned>((count + kBlock - 1) / kBlock), kBlock, 0, LaunchStream()>>>(slots, count);
  CheckLaunch("sum_slots");
}

#else

void SumSlots(const SlotsOfSplats&, int64_t) { DeviceWait("splats"); }

#endif

}  // namespace regrade
