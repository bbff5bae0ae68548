#include "kernels/splats/cuda/tile_lists.h"

#include <utility>

#include "kernels/base/error.h"
#include "kernels/device/device_stream.h"
#include "kernels/device/launch_size.h"
#include "kernels/splats/cuda/grow_buffer.h"

#if defined(__CUDACC__)
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#endif

namespace regrade {

#if defined(__CUDACC__)

namespace {

constexpr int kManyTiles = 48;  // a warp shares the work for splats with more

__device__ int64_t Thread() {
  return blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
}

// offset [n + 1]: tiles of splats in order, with a 0 at the end.
__global__ void CountInOrder(const int32_t* order, const int32_t* num_tiles, int64_t n,
                             int64_t* offset) {
  const int64_t k = Thread();
  if (k <= n) offset[k] = k < n ? num_tiles[order[k]] : 0;
}

template <typename Key>
__device__ void MakeEntry(int64_t slot, int tile, int32_t splat, Key* key, int32_t* entry) {
  key[slot] = static_cast<Key>(tile);
  entry[slot] = splat;
}

// A thread for each splat in order.
template <typename Key>
__global__ void MakeEntries(const int32_t* order, const int64_t* offset, int64_t n,
                            const SplatRecord* record, TileGrid grid, int32_t* first_slot,
                            Key* key, int32_t* entry) {
  const int64_t k = Thread();
  const int64_t first = k < n ? offset[k] : 0;
  const int64_t count = k < n ? offset[k + 1] - first : 0;
  const int32_t splat = count > 0 ? order[k] : 0;
  if (count > 0) {
    first_slot[splat] = static_cast<int32_t>(first);
    if (count <= kManyTiles)
      SplatTiles(record[splat], grid).ForAll([&](int tile, int place) {
        MakeEntry(first + place, tile, splat, key, entry);
      });
  }
  for (unsigned many = __ballot_sync(0xFFFFFFFF, count > kManyTiles); many != 0;
       many &= many - 1) {
    const int lane = __ffs(static_cast<int>(many)) - 1;
    const int32_t shared = __shfl_sync(0xFFFFFFFF, splat, lane);
    const int64_t from = __shfl_sync(0xFFFFFFFF, first, lane);
    SplatTiles(record[shared], grid).ForAllByWarp([&](int tile, int place) {
      MakeEntry(from + place, tile, shared, key, entry);
    });
  }
}

template <typename Key>
__global__ void FindRanges(const Key* key, int64_t entries, int32_t* first, int32_t* end) {
  const int64_t e = Thread();
  if (e >= entries) return;
  const Key own = key[e];
  if (e == 0 || key[e - 1] != own) first[own] = static_cast<int32_t>(e);
  if (e + 1 == entries || key[e + 1] != own) end[own] = static_cast<int32_t>(e + 1);
}

int BitsOf(int64_t values) {
  int bits = 1;
  while (int64_t{1} << bits < values) ++bits;
  return bits;
}

// Calls function(scratch, bytes) first for the size of its scratch memory.
template <typename Function>
void WithScratch(DeviceBuffer<uint8_t>* scratch, const Function& function) {
  size_t bytes = 0;
  function(nullptr, bytes);
  GrowBuffer(static_cast<int64_t>(bytes), "scratch of a sort or scan", scratch);
  function(scratch->data(), bytes);
  CheckLaunch("sort_or_scan");
}

// The sorted values are in values->Current().
template <typename Key>
void Sort(int64_t count, int end_bit, cub::DoubleBuffer<Key>* keys,
          cub::DoubleBuffer<int32_t>* values, DeviceBuffer<uint8_t>* scratch) {
  WithScratch(scratch, [&](void* memory, size_t& bytes) {
    cub::DeviceRadixSort::SortPairs(memory, bytes, *keys, *values, static_cast<int>(count), 0,
                                    end_bit, LaunchStream());
  });
}

}  // namespace

void TileLists::Make(const SeenSplats& seen, int64_t count, const TileGrid& grid) {
  const int64_t tiles = grid.count();
  REGRADE_CHECK(count < INT32_MAX);
  GrowBuffer(count, "order of splats", &z_bits_);
  GrowBuffer(count, "order of splats", &index_);
  GrowBuffer(count, "slots of splats", &first_slot_);
  GrowBuffer(count + 1, "slots of splats", &offset_);
  GrowBuffer(2 * tiles, "lists of tiles", &ranges_);
  ranges_.Zero();
  view_ = {grid, nullptr, ranges_.data(), ranges_.data() + tiles};
  num_entries_ = 0;
  if (count == 0) return;

  cub::DoubleBuffer<uint32_t> z(seen.z_bits, z_bits_.data());
  cub::DoubleBuffer<int32_t> order(seen.index, index_.data());
  Sort(count, 32, &z, &order, &scratch_);
  CountInOrder<<<BlocksFor(count + 1), kThreads, 0, LaunchStream()>>>(
      order.Current(), seen.num_tiles, count, offset_.data());
  CheckLaunch("count_in_order");
  WithScratch(&scratch_, [&](void* memory, size_t& bytes) {
    cub::DeviceScan::ExclusiveSum(memory, bytes, offset_.data(), offset_.data(),
                                  static_cast<int>(count + 1), LaunchStream());
  });
  DeviceCopyOut(&num_entries_, offset_.data() + count, sizeof num_entries_);
  if (num_entries_ == 0) return;
  if (num_entries_ > INT32_MAX)
    throw Error(ExitCode::kResources,
                std::to_string(num_entries_) + " splats in tiles are too many", "GPU",
                "lower the size of pictures, or the number of splats");

  GrowBuffer(num_entries_, "splats of tiles", &entries_);
  GrowBuffer(num_entries_, "splats of tiles", &other_entries_);
  cub::DoubleBuffer<int32_t> entries(entries_.data(), other_entries_.data());
  const auto with_keys = [&](auto zero) {
    using Key = decltype(zero);
    // Both arrays begin at a multiple of 256 bytes.
    const int64_t bytes = (num_entries_ * int64_t{sizeof(Key)} + 255) / 256 * 256;
    GrowBuffer(2 * bytes, "tiles of splats", &tile_keys_);
    cub::DoubleBuffer<Key> keys(reinterpret_cast<Key*>(tile_keys_.data()),
                                reinterpret_cast<Key*>(tile_keys_.data() + bytes));
    MakeEntries<<<BlocksFor(count), kThreads, 0, LaunchStream()>>>(
        order.Current(), offset_.data(), count, seen.record, grid, first_slot_.data(),
        keys.Current(), entries.Current());
    CheckLaunch("make_entries");
    Sort(num_entries_, BitsOf(tiles), &keys, &entries, &scratch_);
    FindRanges<<<BlocksFor(num_entries_), kThreads, 0, LaunchStream()>>>(
        keys.Current(), num_entries_, ranges_.data(), ranges_.data() + tiles);
    CheckLaunch("find_ranges");
  };
  if (tiles <= 65536)
    with_keys(uint16_t{});
  else
    with_keys(uint32_t{});
  view_.splat = entries.Current();
}

#else

void TileLists::Make(const SeenSplats&, int64_t, const TileGrid&) { DeviceWait("splats"); }

#endif

}  // namespace regrade
