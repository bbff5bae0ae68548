// A bucket's splats are those of 16 lanes, two each, and the tile's pixels pass along the
// lanes: in step s, lane l adds pixel s - l to the sums of its own splats, and hands the
// pixel's state to the next lane. So a splat's sums stay in registers, and a pixel's state is
// two numbers: T_i, and what the splats from i on and the background add to the loss,
//   b_i = b_0 - sum_{j < i} w_j s_j,   s_j = <c_j, d_C> + z_j d_Z,
//   b_0 = <C, d_C> + Z d_Z + T_N d_T.
// With R_i as in compositing.h, b_i = T_i <R_i, (d_C, d_Z, d_T)>, and so
//   g_i = alpha_i d_alpha_i = alpha_i (T_i s_i - b_{i+1} / (1 - alpha_i)).
// The difference leaves some roundings of b_0 in b_{i+1}: little to the gradient by splats in
// front, but 1e-4 of that by a splat which all pixels see at T near 1e-3.
#include "kernels/device/device_stream.h"
#include "kernels/splats/cuda/device_math.h"
#include "kernels/splats/cuda/tile_adjoint.h"
#include "kernels/splats/cuda/tile_pixels.h"
#include "kernels/splats/cuda/tile_splat.h"
#include "kernels/splats/splat_camera.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

constexpr int kGroups = 4;  // buckets of a block
static_assert(kGroups <= kBucketRoom);

struct PixelState {
  float transmittance;  // 0: ended
  float behind;         // b_i
};

// Of one splat, with w' of TileSplat for w.
struct Sums {
  float h0 = 0, h1 = 0, h00 = 0, h01 = 0, h11 = 0, f = 0, red = 0, green = 0, blue = 0, z = 0;

  // g of a pixel at w', and its weight.
  template <bool kDepth>
  __device__ void Add(float g, float across, float along, float weight, const float4& d,
                      float d_depth) {
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
    return {{h0 * k, h1 * k},
            {h00 * k * k, h01 * k * k, h11 * k * k},
            f,
            {red, green, blue},
            z,
            stamp};
  }
};

// A pixel at a lane's splats.
struct AtPixel {
  float across[kSplatsOfLane], along[kSplatsOfLane];  // w'
  float g[kSplatsOfLane], weight[kSplatsOfLane];

  // Takes the pixel's state from before the first splat to behind the last one. What does not
  // depend on it comes first, for all splats, so that its latencies overlap.
  template <bool kDepth>
  __device__ void Pass(const TileSplat* splat, float x, float y, const float4& d, float d_depth,
                       PixelState* state) {
    float full[kSplatsOfLane], alpha[kSplatsOfLane], inverse[kSplatsOfLane];
#pragma unroll
    for (int k = 0; k < kSplatsOfLane; ++k) {
      across[k] = splat[k].Across(x);
      along[k] = splat[k].Along(splat[k].Slant(x), y);
      const float exponent = splat[k].Exponent(across[k], along[k]);
      full[k] = FastExp2(exponent);
      alpha[k] = TileSplat::Sees(exponent) ? fminf(full[k], float(kMaxAlpha)) : 0.0f;
      inverse[k] = FastReciprocal(1 - alpha[k]);
    }
#pragma unroll
    for (int k = 0; k < kSplatsOfLane; ++k) {
      const float t = state->transmittance, after = t * (1 - alpha[k]);
      const bool stays = after >= float(kMinTransmittance);
      const float counts = stays ? alpha[k] : 0.0f;
      state->transmittance = stays ? after : 0.0f;
      weight[k] = t * counts;
      float s = d.x * splat[k].color.x;
      s = fmaf(d.y, splat[k].color.y, s);
      s = fmaf(d.z, splat[k].color.z, s);
      if constexpr (kDepth) s = fmaf(d_depth, splat[k].z, s);
      state->behind = fmaf(-weight[k], s, state->behind);
      const float d_alpha = fmaf(t, s, -state->behind * inverse[k]);
      g[k] = full[k] < float(kMaxAlpha) ? counts * d_alpha : 0.0f;
    }
  }
};

template <bool kDepth>
__global__ void __launch_bounds__(kGroups* kBucketLanes, kDepth ? 12 : 14)
    Adjoint(TileListsView lists, const SplatRecord* record, KeptTiles kept,
            TileGradients gradients, uint32_t stamp, SlotSums* sums) {
  __shared__ alignas(16) char shared[kGroups * sizeof(TileState)];
  __shared__ TileDepths all_depths[kDepth ? kGroups : 1];
  const int group = static_cast<int>(threadIdx.x) / kBucketLanes;
  const int lane = static_cast<int>(threadIdx.x) % kBucketLanes;
  TileState* const tile = reinterpret_cast<TileState*>(shared) + group;
  TileDepths* const depths = all_depths + (kDepth ? group : 0);
  const int64_t place = blockIdx.x * int64_t{kGroups} + group;
  const int num_buckets = *kept.num_buckets;
  const TileBucket loaded = kept.bucket[place];  // or of the room behind the last one
  const bool on = place < num_buckets;
  if (!__any_sync(kWholeWarp, on)) return;
  // Groups without a bucket do that of the warp's first group again, and write nothing.
  const int source = on ? static_cast<int>(threadIdx.x % 32) : 0;
  const TileBucket bucket = {__shfl_sync(kWholeWarp, loaded.tile, source),
                             __shfl_sync(kWholeWarp, loaded.first, source),
                             __shfl_sync(kWholeWarp, loaded.end, source),
                             __shfl_sync(kWholeWarp, loaded.checkpoint, source)};
  const int first = bucket.first + lane * kSplatsOfLane;
  BeginToLoad(bucket, lane, kept, gradients, tile);
  TileEntry entry[kSplatsOfLane];
  SplatRecord own[kSplatsOfLane];
#pragma unroll
  for (int k = 0; k < kSplatsOfLane; ++k)
    entry[k] = lists.entry[min(first + k, bucket.end - 1)];
#pragma unroll
  for (int k = 0; k < kSplatsOfLane; ++k) {
    own[k] = record[entry[k].splat];
    tile->slot[lane * kSplatsOfLane + k] = entry[k].slot;
  }
  const int left = bucket.tile % lists.grid.columns * kDeviceTile;
  const int top = bucket.tile / lists.grid.columns * kDeviceTile;
  TileSplat splat[kSplatsOfLane];
  Sums sum[kSplatsOfLane];
#pragma unroll
  for (int k = 0; k < kSplatsOfLane; ++k) {
    splat[k] = TileSplat(own[k], left, top);
    if (first + k >= bucket.end) splat[k].lo = TileSplat().lo;
  }
  __pipeline_wait_prior(0);
  __syncwarp();
  const int count = KeepAlive<kDepth>(bucket, lane, kept, gradients, tile, depths);
  // All groups of a warp go as many steps.
  int most = count;
  for (int other = kBucketLanes; other < 32; other *= 2)
    most = max(most, __shfl_xor_sync(kWholeWarp, most, other));
  const int steps = most + kBucketLanes - 1;
  ClearAround<kDepth>(count, steps, lane, tile, depths);
  __syncwarp();

  const float4* const d_pixel = tile->d + (kBucketLanes - lane);
  const float* const d_depth = depths->d + (kBucketLanes - lane);
  PixelState state{0, 0};
  float4 next_d = d_pixel[0];
  float2 next_state = *reinterpret_cast<const float2*>(tile->state);
  for (int step = 0; step < steps; ++step) {
    if (lane == 0) state = {next_state.x, next_state.y};
    const float4 d = next_d;
    const float pixel_depth = kDepth ? d_depth[step] : 0.0f;
    // Of the next step; there is a place after the last one.
    next_d = d_pixel[step + 1];
    next_state = *reinterpret_cast<const float2*>(tile->state + step + 1);
    float x, y;
    Unpack(d.w, &x, &y);
    AtPixel at;
    at.Pass<kDepth>(splat, x, y, d, pixel_depth, &state);
    // The next lane's state is on its way while the sums are added.
    state.transmittance = __shfl_up_sync(kWholeWarp, state.transmittance, 1, kBucketLanes);
    state.behind = __shfl_up_sync(kWholeWarp, state.behind, 1, kBucketLanes);
#pragma unroll
    for (int k = 0; k < kSplatsOfLane; ++k)
      sum[k].Add<kDepth>(at.g[k], at.across[k], at.along[k], at.weight[k], d, pixel_depth);
  }
#pragma unroll
  for (int k = 0; k < kSplatsOfLane; ++k)
    if (on && first + k < bucket.end)
      sums[tile->slot[lane * kSplatsOfLane + k]] = sum[k].Unscaled(stamp);
}

}  // namespace

void AddTileAdjoints(const TileListsView& lists, const SplatRecord* record,
                     const KeptTiles& kept, int64_t max_buckets, const TileGradients& gradients,
                     uint32_t stamp, SlotSums* sums) {
  const unsigned blocks = static_cast<unsigned>((max_buckets + kGroups - 1) / kGroups);
  if (blocks == 0) return;
  if (gradients.depth != nullptr)
    Adjoint<true><<<blocks, kGroups * kBucketLanes, 0, LaunchStream()>>>(
        lists, record, kept, gradients, stamp, sums);
  else
    Adjoint<false><<<blocks, kGroups * kBucketLanes, 0, LaunchStream()>>>(
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
