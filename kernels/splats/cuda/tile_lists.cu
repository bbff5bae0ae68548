#include <utility>

#include "kernels/base/error.h"
#include "kernels/device/device_stream.h"
#include "kernels/device/launch_size.h"
#include "kernels/splats/cuda/device_math.h"
#include "kernels/splats/cuda/grow_buffer.h"
#include "kernels/splats/cuda/tile_lists.h"

#if defined(__CUDACC__)
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#endif

namespace regrade {

#if defined(__CUDACC__)

namespace {

constexpr int kManyTiles = 48;      // a warp shares the work for splats with more
constexpr int kEntryThreads = 128;  // of a block that makes entries
constexpr int kStaged = 768;        // entries of a warp in shared memory

__device__ int64_t Thread() {
  return blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
}

// offset [n + 1]: tiles of splats in order, with a 0 at the end.
__global__ void CountInOrder(const int32_t* order, const int32_t* num_tiles, int64_t n,
                             int64_t* offset) {
  const int64_t k = Thread();
  if (k <= n) offset[k] = k < n ? num_tiles[order[k]] : 0;
}

// A thread for each splat in order. The slots of a warp's splats are consecutive: they are made
// in shared memory, if there is room, and written in order.
template <typename Key>
__global__ void __launch_bounds__(kEntryThreads)
    MakeEntries(const int32_t* order, const int64_t* offset, int64_t n,
                const SplatRecord* record, TileGrid grid, int32_t* first_slot, Key* key,
                TileEntry* entry) {
  __shared__ uint32_t staged[kEntryThreads / 32][kStaged];  // tile, lane of the splat
  uint32_t* const stage = staged[threadIdx.x / 32];
  const int lane = static_cast<int>(threadIdx.x % 32);
  const int64_t k = Thread();
  const int64_t first = offset[min(k, n)], end = offset[min(k + 1, n)];
  const int64_t begin_of_warp = __shfl_sync(kWholeWarp, first, 0);
  const int64_t end_of_warp = __shfl_sync(kWholeWarp, end, 31);
  if (begin_of_warp == end_of_warp) return;
  const int32_t splat = first < end ? order[k] : 0;
  if (first < end) first_slot[splat] = static_cast<int32_t>(first);
  const bool many = end - first > kManyTiles;
  const bool in_stage = end_of_warp - begin_of_warp <= kStaged;
  const int start = static_cast<int>(first - begin_of_warp);
  if (first < end && !(many && !in_stage))
    SplatTiles(record[splat], grid).ForAll([&](int tile, int place) {
      if (in_stage) {
        stage[start + place] = static_cast<uint32_t>(tile) << 5 | static_cast<uint32_t>(lane);
      } else {
        key[first + place] = static_cast<Key>(tile);
        entry[first + place] = {splat, static_cast<int32_t>(first) + place};
      }
    });
  if (in_stage) {
    __syncwarp();
    const int total = static_cast<int>(end_of_warp - begin_of_warp);
    for (int base = 0; base < total; base += 32) {
      const int at = base + lane;
      const uint32_t made = at < total ? stage[at] : 0;
      const int32_t its = __shfl_sync(kWholeWarp, splat, static_cast<int>(made & 31));
      if (at >= total) continue;
      key[begin_of_warp + at] = static_cast<Key>(made >> 5);
      entry[begin_of_warp + at] = {its, static_cast<int32_t>(begin_of_warp) + at};
    }
    return;
  }
  for (unsigned left = __ballot_sync(kWholeWarp, many); left != 0; left &= left - 1) {
    const int source = __ffs(static_cast<int>(left)) - 1;
    const int32_t shared = __shfl_sync(kWholeWarp, splat, source);
    const int64_t from = __shfl_sync(kWholeWarp, first, source);
    SplatTiles(record[shared], grid).ForAllByWarp([&](int tile, int place) {
      key[from + place] = static_cast<Key>(tile);
      entry[from + place] = {shared, static_cast<int32_t>(from) + place};
    });
  }
}

// A thread for kRun consecutive entries.
constexpr int kRun = 4;
template <typename Key>
__global__ void FindRanges(const Key* key, int64_t entries, int32_t* first, int32_t* end) {
  const int64_t begin = kRun * Thread();
  if (begin >= entries) return;
  int64_t before = begin > 0 ? int64_t{key[begin - 1]} : -1;
#pragma unroll
  for (int k = 0; k <= kRun; ++k) {
    const int64_t e = begin + k;
    const int64_t own = e < entries ? int64_t{key[e]} : -1;
    if (own != before) {
      if (k < kRun && own >= 0) first[own] = static_cast<int32_t>(e);
      if (k > 0 && before >= 0) end[before] = static_cast<int32_t>(e);
    }
    before = own;
  }
}

__global__ void CopySplatsKernel(const TileEntry* entry, int64_t entries, int32_t* splat) {
  const int64_t e = Thread();
  if (e < entries) splat[e] = entry[e].splat;
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
template <typename Key, typename Value>
void Sort(int64_t count, int end_bit, cub::DoubleBuffer<Key>* keys,
          cub::DoubleBuffer<Value>* values, DeviceBuffer<uint8_t>* scratch) {
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
  order_ = order.Current();
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
  cub::DoubleBuffer<TileEntry> entries(entries_.data(), other_entries_.data());
  const auto with_keys = [&](auto zero) {
    using Key = decltype(zero);
    // Both arrays begin at a multiple of 256 bytes.
    const int64_t bytes = (num_entries_ * int64_t{sizeof(Key)} + 255) / 256 * 256;
    GrowBuffer(2 * bytes, "tiles of splats", &tile_keys_);
    cub::DoubleBuffer<Key> keys(reinterpret_cast<Key*>(tile_keys_.data()),
                                reinterpret_cast<Key*>(tile_keys_.data() + bytes));
    const unsigned blocks = static_cast<unsigned>((count + kEntryThreads - 1) / kEntryThreads);
    MakeEntries<<<blocks, kEntryThreads, 0, LaunchStream()>>>(
        order.Current(), offset_.data(), count, seen.record, grid, first_slot_.data(),
        keys.Current(), entries.Current());
    CheckLaunch("make_entries");
    Sort(num_entries_, BitsOf(tiles), &keys, &entries, &scratch_);
    FindRanges<<<BlocksFor((num_entries_ + kRun - 1) / kRun), kThreads, 0, LaunchStream()>>>(
        keys.Current(), num_entries_, ranges_.data(), ranges_.data() + tiles);
    CheckLaunch("find_ranges");
  };
  if (tiles <= 65536)
    with_keys(uint16_t{});
  else
    with_keys(uint32_t{});
  view_.entry = entries.Current();
}

void TileLists::CopySplats(int32_t* splat) const {
  if (num_entries_ == 0) return;
  CopySplatsKernel<<<BlocksFor(num_entries_), kThreads, 0, LaunchStream()>>>(
      view_.entry, num_entries_, splat);
  CheckLaunch("copy_splats");
}

#else

void TileLists::Make(const SeenSplats&, int64_t, const TileGrid&) { DeviceWait("splats"); }
void TileLists::CopySplats(int32_t*) const { DeviceWait("splats"); }

#endif

}  // namespace regrade
