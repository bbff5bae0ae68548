// A bucket's splats are the splats of 8 lanes, four each, and the tile's pixels pass along the
// lanes: in step s, lane l adds pixel s - l to its own splats' sums, and hands the pixel's state
// to the next lane. So a splat's sums stay in registers, and a pixel's state is two numbers: T_i
// and the scalar
//   b_i = <C_i, d_C> + Z_i d_Z + T_N d_T = b_0 - sum_{j < i} w_j s_j,   s_j = <c_j, d_C> + z_j d_Z,
// (C_i, Z_i) what splats from i on add, with the background: T_{i+1} <R_{i+1}, (d_C, d_Z, d_T)> =
// b_{i+1}, and so
//   g_i = alpha_i d_alpha_i = alpha_i (T_i s_i - b_{i+1} / (1 - alpha_i)).
// The difference b_0 - ... leaves an error of some roundings of the pixel's b_0 in b_{i+1}, which
// is small to the gradient of the splats in front, not to that of splats behind T = 1e-4.
#include "kernels/splats/cuda/tile_adjoint.h"

#include "kernels/device/device_stream.h"
#include "kernels/splats/cuda/tile_splat.h"
#include "kernels/splats/splat_camera.h"

#if defined(__CUDACC__)
#include <cuda_pipeline.h>
#endif

namespace regrade {

#if defined(__CUDACC__)

namespace {

#ifndef ADJ_BLOCKS
#define ADJ_BLOCKS 9
#endif
#ifndef ADJ_LANES
#define ADJ_LANES 8
#endif
constexpr unsigned kAll = 0xFFFFFFFF;
constexpr int kLanes = ADJ_LANES;                  // of a bucket
constexpr int kOfLane = kBucket / kLanes;  // splats of a lane
constexpr int kGroups = 64 / kLanes;                 // buckets of a block

struct PixelState {
  float transmittance;  // 0: ended
  float behind;         // b_i
};

// The pixels of a tile that reach a bucket, one after the other; zeros before and after them
// are what lanes add in steps without a pixel.
struct alignas(16) TileState {
  float4 d[kLanes + kTilePixels + kLanes];  // d_C; the pixel's number in the tile, as bits
  float4 state[kTilePixels + kLanes];       // T_i, b_i
  int32_t slot[kBucket];                    // of the splats
};
struct TileDepths {
  float d[kLanes + kTilePixels + kLanes];  // d_Z
};

// Of one splat, with w' of TileSplat for w.
struct Sums {
  float h0 = 0, h1 = 0, h00 = 0, h01 = 0, h11 = 0, f = 0, red = 0, green = 0, blue = 0, z = 0;

  template <bool kDepth>
  __device__ void Add(const TileSplat& splat, float x, float y, const float4& d, float d_depth,
                      PixelState* state) {
    const float across = splat.Across(x), along = splat.Along(splat.Slant(x), y);
    const float exponent = splat.Exponent(across, along);
    const float full = FastExp2(exponent);
    float alpha = TileSplat::Sees(exponent) ? fminf(full, float(kMaxAlpha)) : 0.0f;
    const float clear = 1 - alpha, t = state->transmittance, after = t * clear;
    const bool stays = after >= float(kMinTransmittance);
    alpha = stays ? alpha : 0.0f;
    state->transmittance = stays ? after : 0.0f;
    const float weight = t * alpha;
    float s = d.x * splat.color.x;
    s = fmaf(d.y, splat.color.y, s);
    s = fmaf(d.z, splat.color.z, s);
    if constexpr (kDepth) s = fmaf(d_depth, splat.z, s);
    state->behind = fmaf(-weight, s, state->behind);
    const float d_alpha = fmaf(t, s, -state->behind * FastReciprocal(clear));
    const float g = full < float(kMaxAlpha) ? alpha * d_alpha : 0.0f;
    const float g0 = g * across, g1 = g * along;
    f += g;
    h0 += g0;
    h1 += g1;
    h00 = fmaf(g0, across, h00);
    h01 = fmaf(g0, along, h01);
    h11 = fmaf(g1, along, h11);
    red = fmaf(weight, d.x, red);
    green = fmaf(weight, d.y, green);
    blue = fmaf(weight, d.z, blue);
    if constexpr (kDepth) z = fmaf(weight, d_depth, z);
  }

  __device__ SlotSums Unscaled(uint32_t stamp) const {
    constexpr float k = 1 / TileSplat::kScale;
    return {{h0 * k, h1 * k}, {h00 * k * k, h01 * k * k, h11 * k * k}, f, {red, green, blue}, z,
            stamp};
  }
};

// Begins to copy the gradients of a tile's pixels to tile->d, and the pixels as they were before
// the bucket to tile->state.
__device__ void BeginToLoad(const TileBucket& bucket, int lane, const KeptTiles& kept,
                            const TileGradients& gradients, TileState* tile) {
  const int64_t pixels = int64_t{bucket.tile} * kTilePixels;
  const int64_t place = int64_t{bucket.checkpoint} * kTilePixels;
#pragma unroll
  for (int p = lane; p < kTilePixels; p += kLanes) {
    __pipeline_memcpy_async(tile->d + kLanes + p, gradients.pixel + pixels + p, 16);
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
  for (int j = 0; j < kTilePixels / kLanes; ++j) {
    const int p = lane + j * kLanes;  // not before any place that is written
    const float4 d = tile->d[kLanes + p], before = tile->state[p];
    const bool alive = before.x > 0;
    const unsigned group = __ballot_sync(kAll, alive) >> shift & ((1u << kLanes) - 1);
    __syncwarp();
    if (alive) {
      const int to = count + __popc(group & ((1u << lane) - 1));
      float behind = d.w - (before.y * d.x + before.z * d.y + before.w * d.z);
      if constexpr (kDepth) {
        const float d_depth = gradients.depth[int64_t{bucket.tile} * kTilePixels + p];
        behind -= kept.depth[int64_t{bucket.checkpoint} * kTilePixels + p] * d_depth;
        depths->d[kLanes + to] = d_depth;
      }
      tile->d[kLanes + to] = {d.x, d.y, d.z, __int_as_float(p)};
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
  for (int p = count + lane; p < end; p += kLanes) {
    tile->d[kLanes + p] = zero;
    tile->state[p] = zero;
    if constexpr (kDepth) depths->d[kLanes + p] = 0;
  }
}

template <bool kDepth>
__global__ void __launch_bounds__(kGroups* kLanes, kLanes == 8 ? ADJ_BLOCKS : 14)
    Adjoint(TileListsView lists, const SplatRecord* record, KeptTiles kept,
            TileGradients gradients, uint32_t stamp, SlotSums* sums) {
  __shared__ alignas(16) char shared[kGroups * sizeof(TileState)];
  __shared__ TileDepths all_depths[kDepth ? kGroups : 1];
  const int group = static_cast<int>(threadIdx.x) / kLanes;
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  TileState* const tile = reinterpret_cast<TileState*>(shared) + group;
  TileDepths* const depths = all_depths + (kDepth ? group : 0);
  const int64_t place = blockIdx.x * int64_t{kGroups} + group;
  const int num_buckets = *kept.num_buckets;
  if (blockIdx.x * int64_t{kGroups} >= num_buckets) return;
  // Groups without a bucket do the last one again, and write nothing.
  const bool on = place < num_buckets;
  const TileBucket bucket = kept.bucket[min(place, int64_t{num_buckets - 1})];
  const int first = bucket.first + lane * kOfLane;
  BeginToLoad(bucket, lane, kept, gradients, tile);
  TileEntry entry[kOfLane];
  SplatRecord own[kOfLane];
#pragma unroll
  for (int k = 0; k < kOfLane; ++k) entry[k] = lists.entry[min(first + k, bucket.end - 1)];
#pragma unroll
  for (int k = 0; k < kOfLane; ++k) {
    own[k] = record[entry[k].splat];
    tile->slot[lane * kOfLane + k] = entry[k].slot;
  }
  const int left = bucket.tile % lists.grid.columns * kDeviceTile;
  const int top = bucket.tile / lists.grid.columns * kDeviceTile;
  TileSplat splat[kOfLane];
  Sums sum[kOfLane];
#pragma unroll
  for (int k = 0; k < kOfLane; ++k) {
    splat[k] = TileSplat(own[k], left, top);
    if (first + k >= bucket.end) splat[k].lo = TileSplat().lo;
  }
  __pipeline_wait_prior(0);
  __syncwarp();
  const int count = KeepAlive<kDepth>(bucket, lane, kept, gradients, tile, depths);
  // All groups of a warp go as many steps.
  int most = count;
  for (int other = kLanes; other < 32; other *= 2)
    most = max(most, __shfl_xor_sync(kAll, most, other));
  const int steps = most + kLanes - 1;
  ClearAround<kDepth>(count, steps, lane, tile, depths);
  __syncwarp();

  PixelState state{0, 0};
  const float4* d_pixel = tile->d + (kLanes - lane);
  const float* d_depth = depths->d + (kLanes - lane);
  for (int step = 0; step < steps; ++step) {
    state.transmittance = __shfl_up_sync(kAll, state.transmittance, 1, kLanes);
    state.behind = __shfl_up_sync(kAll, state.behind, 1, kLanes);
    const float2 entering = *reinterpret_cast<const float2*>(tile->state + step);
    if (lane == 0) state = {entering.x, entering.y};
    const float4 d = d_pixel[step];
    const unsigned pixel = __float_as_uint(d.w);
    const float x = static_cast<float>(pixel % kDeviceTile);
    const float y = static_cast<float>(pixel / kDeviceTile);
#pragma unroll
    for (int k = 0; k < kOfLane; ++k)
      sum[k].Add<kDepth>(splat[k], x, y, d, kDepth ? d_depth[step] : 0.0f, &state);
  }
#pragma unroll
  for (int k = 0; k < kOfLane; ++k)
    if (on && first + k < bucket.end)
      sums[tile->slot[lane * kOfLane + k]] = sum[k].Unscaled(stamp);
}

}  // namespace

void AddTileAdjoints(const TileListsView& lists, const SplatRecord* record,
                     const KeptTiles& kept, int64_t max_buckets, const TileGradients& gradients,
                     uint32_t stamp, SlotSums* sums) {
  const unsigned blocks = static_cast<unsigned>((max_buckets + kGroups - 1) / kGroups);
  if (blocks == 0) return;
  if (gradients.depth != nullptr)
    Adjoint<true><<<blocks, kGroups * kLanes, 0, LaunchStream()>>>(
        lists, record, kept, gradients, stamp, sums);
  else
    Adjoint<false><<<blocks, kGroups * kLanes, 0, LaunchStream()>>>(
        lists, record, kept, gradients, stamp, sums);
  CheckLaunch("add_tile_adjoints");
}

#else

void AddTileAdjoints(const TileListsView&, const SplatRecord*, const KeptTiles&, int64_t,
                     const TileGradients&, uint32_t, SlotSums*) {
  DeviceWait("splats");
}

#endif

}  // namespace regrade
