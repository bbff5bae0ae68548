// Sums of every splat over the tiles that it meets.
#pragma once

#include "kernels/splats/cuda/tile_adjoint.h"

namespace regrade {

// The slots of a splat that are marked by `stamp` are added, in double and in their order, to
// the first slot of the splat; the others keep their values. Device pointers: `order` [count]
// has the splats in the order of their slots, those without tiles last.
void SumSlots(const int32_t* order, const int32_t* num_tiles, const int32_t* first_slot,
              int64_t count, uint32_t stamp, SlotSums* sums);

}  // namespace regrade
