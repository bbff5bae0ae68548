// Composites the splats of tiles, see EQ(splat-composite), and keeps what the adjoint needs.
#pragma once

#include "kernels/device/device_memory.h"
#include "kernels/splats/cuda/tile_lists.h"

namespace regrade {

inline constexpr int kBucket = 32;  // consecutive entries of a tile

// Pixels of a picture on the device, in the layouts of SplatPicture.
template <typename T>
struct SplatPixels {
  T* color = nullptr;  // [H, W, 3]
  T* depth = nullptr;
  T* median_depth = nullptr;
  T* transmittance = nullptr;
};

// A pixel before a bucket. T is 0 where the pixel has ended, and beyond the picture.
struct alignas(16) PixelCheckpoint {
  float transmittance;
  Vec3f color;  // without the background
};

// The first bucket of a tile has the checkpoint FirstCheckpoint, and the others follow.
struct alignas(16) TileBucket {
  int32_t tile, first, end, checkpoint;  // entries [first, end)
};

inline constexpr int kBucketRoom = 16;

// What is kept for the adjoint.
struct KeptTiles {
  PixelCheckpoint* checkpoint = nullptr;  // [checkpoints, kTilePixels]
  float* depth = nullptr;                 // [checkpoints, kTilePixels]; or null: not kept
  TileBucket* bucket = nullptr;           // that some pixel of its tile reached, in any order;
                                          // and room for kBucketRoom more
  int32_t* num_buckets = nullptr;         // must be 0 before

  bool on() const { return checkpoint != nullptr; }
};

// Tiles have ceil(entries / kBucket) buckets, and no two the same checkpoint: ceil((f + n) / b)
// is at most floor(f / b) + ceil(n / b) + 1.
HD inline int32_t FirstCheckpoint(int tile, int32_t first_entry) {
  return first_entry / kBucket + tile;
}
inline int64_t NumCheckpoints(int64_t entries, int tiles) {
  return entries / kBucket + tiles + 1;
}

// Writes all arrays of `pixels`, or, if it has no depth, the colour and the transmittance.
void CompositeTiles(const TileListsView& lists, const SplatRecord* record,
                    const Vec3f& background, const SplatPixels<float>& pixels,
                    const KeptTiles& kept);

}  // namespace regrade
