// The adjoint of compositing tiles, see EQ(splat-composite-adjoint): sums of every splat over
// the pixels of every tile.
#pragma once

#include "kernels/device/device_memory.h"
#include "kernels/splats/cuda/composite_tiles.h"
#include "kernels/splats/cuda/pixel_gradients.h"

namespace regrade {

// SplatSums of a splat over a tile's pixels.
struct alignas(16) SlotSums {
  float h[2], H[3], f;
  Vec3f color;
  float z;
  uint32_t stamp;
};

// sums [slots] of the splats in the kept buckets, marked by `stamp`; others are not written.
// `max_buckets`: at least the number of kept buckets. The results have the same bits in every
// run: no sum depends on the order in which threads run.
void AddTileAdjoints(const TileListsView& lists, const SplatRecord* record,
                     const KeptTiles& kept, int64_t max_buckets, const TileGradients& gradients,
                     uint32_t stamp, SlotSums* sums);

}  // namespace regrade
