// The splats of each tile of a picture, front to back, on the device.
//
// An entry is a splat in a tile. Splats are sorted by z once, 31 bits each; their entries are
// made in that order and sorted by tile alone, which keeps the order within tiles.
#pragma once

#include "kernels/device/device_memory.h"
#include "kernels/splats/cuda/see_splats.h"
#include "kernels/splats/cuda/splat_record.h"

namespace regrade {

// A splat in a tile, and the entry's number in the order of splats, then of tiles by rows.
struct alignas(8) TileEntry {
  int32_t splat, slot;
};

// Device pointers.
struct TileListsView {
  TileGrid grid;
  const TileEntry* entry = nullptr;  // [entries], by tile, then front to back
  const int32_t* first = nullptr;    // [tiles]
  const int32_t* end = nullptr;      // [tiles]
};

// 20 bytes for each splat and, with up to 65536 tiles, 20 for each entry, and those of a sort.
class TileLists {
 public:
  // `seen`: of `count` splats; its z_bits and index are overwritten. Waits for the device once.
  // Throws Error(kResources) if there are 2^31 entries or more.
  void Make(const SeenSplats& seen, int64_t count, const TileGrid& grid);

  int64_t num_entries() const { return num_entries_; }
  TileListsView view() const { return view_; }
  // Writes the entries' splats alone, splat [num_entries()].
  void CopySplats(int32_t* splat) const;

  // [splats] The least slot of a splat; undefined for splats without tiles.
  const int32_t* first_slot() const { return first_slot_.data(); }
  // [splats] Splats in the order of their slots, those without tiles last.
  const int32_t* order() const { return order_; }

 private:
  DeviceBuffer<uint32_t> z_bits_;
  DeviceBuffer<int32_t> index_, first_slot_;
  DeviceBuffer<int64_t> offset_;
  DeviceBuffer<uint8_t> tile_keys_;  // two arrays of 2 or 4 bytes
  DeviceBuffer<TileEntry> entries_, other_entries_;
  DeviceBuffer<int32_t> ranges_;
  DeviceBuffer<uint8_t> scratch_;
  const int32_t* order_ = nullptr;
  int64_t num_entries_ = 0;
  TileListsView view_;
};

}  // namespace regrade
