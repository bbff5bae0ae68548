// Sums of every splat over the tiles that it meets.
#pragma once

#include "kernels/splats/cuda/tile_adjoint.h"

namespace regrade {

// Device pointers. The slots of a splat are added, in double and in the order of tiles, to the
// first one of them; the others keep their values. Slots that AddTileAdjoints did not write count
// as zeros. `order` [splats]: splats in the order of their slots, those without tiles last.
struct SlotsOfSplats {
  TileGrid grid;
  const SplatRecord* record = nullptr;  // [splats]
  const int32_t* num_tiles = nullptr;   // [splats]
  const int32_t* first_slot = nullptr;  // [splats]
  const int32_t* order = nullptr;
  const uint64_t* last = nullptr;  // [tiles], see KeptTiles
  SlotSums* sums = nullptr;        // [slots]
};

void SumSlots(const SlotsOfSplats& slots, int64_t count);

}  // namespace regrade
