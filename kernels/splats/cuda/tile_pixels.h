// The pixels of a tile in shared memory, on their way along the lanes of a bucket. Device code
// only.
#pragma once

#include "kernels/splats/cuda/composite_tiles.h"
#include "kernels/splats/cuda/device_math.h"
#include "kernels/splats/cuda/pixel_gradients.h"

#if defined(__CUDACC__)

#include <cuda_pipeline.h>

namespace regrade {

constexpr int kBucketLanes = 16;                       // of a bucket
constexpr int kSplatsOfLane = kBucket / kBucketLanes;  // splats of a lane

// The pixels of a tile that reach a bucket, one after the other; zeros before and after them
// are what lanes add in steps without a pixel.
struct alignas(16) TileState {
  float4 d[kBucketLanes + kTilePixels + kBucketLanes];  // d_C; the pixel's place, see Packed
  float4 state[kTilePixels + kBucketLanes];             // T_i, b_i
  int32_t slot[kBucket];                                // of the splats
};
struct TileDepths {
  float d[kBucketLanes + kTilePixels + kBucketLanes];  // d_Z
};

// A pixel's place in its tile as one float, and back, in the units for floats.
__device__ inline float Packed(int pixel) {
  return static_cast<float>(16 * (pixel / kDeviceTile) + pixel % kDeviceTile);
}
__device__ inline void Unpack(float packed, float* x, float* y) {
  constexpr float kRound = 12582912;  // 1.5 * 2^23: what is added to it is rounded
  *y = __fsub_rn(__fmaf_rn(packed, 0.0625f, kRound), kRound);
  *x = __fmaf_rn(-16, *y, packed);
}

// Begins to copy the gradients of a tile's pixels to tile->d, and the pixels as they were
// before the bucket to tile->state.
__device__ inline void BeginToLoad(const TileBucket& bucket, int lane, const KeptTiles& kept,
                                   const TileGradients& gradients, TileState* tile) {
  const int64_t pixels = int64_t{bucket.tile} * kTilePixels;
  const int64_t place = int64_t{bucket.checkpoint} * kTilePixels;
#pragma unroll
  for (int p = lane; p < kTilePixels; p += kBucketLanes) {
    __pipeline_memcpy_async(tile->d + kBucketLanes + p, gradients.pixel + pixels + p, 16);
    __pipeline_memcpy_async(tile->state + p, kept.checkpoint + place + p, 16);
  }
  __pipeline_commit();
}

// Moves what was copied to the places of TileState, without pixels that have ended; returns how
// many are left. Called by whole warps.
template <bool kDepth>
__device__ int KeepAlive(const TileBucket& bucket, int lane, const KeptTiles& kept,
                         const TileGradients& gradients, TileState* tile, TileDepths* depths) {
  const int shift = static_cast<int>(threadIdx.x % 32) - lane;
  int count = 0;
#pragma unroll
  for (int j = 0; j < kTilePixels / kBucketLanes; ++j) {
    const int p = lane + j * kBucketLanes;  // not before any place that is written
    const float4 d = tile->d[kBucketLanes + p], before = tile->state[p];
    const bool alive = before.x > 0;
    const unsigned group =
        __ballot_sync(kWholeWarp, alive) >> shift & ((1u << kBucketLanes) - 1);
    __syncwarp();
    if (alive) {
      const int to = count + __popc(group & ((1u << lane) - 1));
      float behind = d.w - (before.y * d.x + before.z * d.y + before.w * d.z);
      if constexpr (kDepth) {
        const float d_depth = gradients.depth[int64_t{bucket.tile} * kTilePixels + p];
        behind -= kept.depth[int64_t{bucket.checkpoint} * kTilePixels + p] * d_depth;
        depths->d[kBucketLanes + to] = d_depth;
      }
      tile->d[kBucketLanes + to] = {d.x, d.y, d.z, Packed(p)};
      tile->state[to] = {before.x, behind, 0, 0};
    }
    count += __popc(group);
  }
  return count;
}

template <bool kDepth>
__device__ void ClearAround(int count, int end, int lane, TileState* tile, TileDepths* depths) {
  const float4 zero{0, 0, 0, 0};
  tile->d[lane] = zero;
  if constexpr (kDepth) depths->d[lane] = 0;
  for (int p = count + lane; p < end; p += kBucketLanes) {
    tile->d[kBucketLanes + p] = zero;
    tile->state[p] = zero;
    if constexpr (kDepth) depths->d[kBucketLanes + p] = 0;
  }
}

}  // namespace regrade

#endif
