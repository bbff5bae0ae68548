// A bucket's splats are the lanes of half a warp, two splats each, and the tile's pixels pass
// along the lanes: in step s, lane l adds pixel s - l to its own splats' sums, and hands the
// pixel's state to the next lane. So a splat's sums stay in registers, and a pixel's state is two
// numbers: T_i and the scalar
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

namespace regrade {

#if defined(__CUDACC__)

namespace {

constexpr int kLanes = 16;                    // of a bucket
constexpr int kOfLane = kBucket / kLanes;     // splats of a lane
constexpr int kGroups = 8;                    // buckets of a block
constexpr int kSteps = kTilePixels + kLanes - 1;

struct PixelState {
  float transmittance;  // 0: ended
  float behind;         // b_i
};

// A tile's pixels before a bucket.
struct alignas(16) TileState {
  float4 d[kTilePixels];  // d_C, d_Z
  float2 state[kSteps + 1];
};

// Of one splat, with w' of TileSplat for w.
struct Sums {
  float h0 = 0, h1 = 0, h00 = 0, h01 = 0, h11 = 0, f = 0, red = 0, green = 0, blue = 0, z = 0;

  template <bool kDepth>
  __device__ void Add(const TileSplat& splat, float x, float y, const float4& d,
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
    if constexpr (kDepth) s = fmaf(d.w, splat.z, s);
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
    if constexpr (kDepth) z = fmaf(weight, d.w, z);
  }

  __device__ SlotSums Unscaled() const {
    constexpr float k = 1 / TileSplat::kScale;
    return {{h0 * k, h1 * k}, {h00 * k * k, h01 * k * k, h11 * k * k}, f, {red, green, blue}, z};
  }
};

// Lane l loads the pixels l, l + kLanes ...
template <bool kDepth>
__device__ void LoadPixels(const TileGrid& grid, const TileBucket& bucket, int64_t checkpoint,
                           int lane, const KeptTiles& kept, const TileGradients& gradients,
                           TileState* tile) {
#pragma unroll
  for (int j = 0; j < kTilePixels / kLanes; ++j) {
    const int p = lane + j * kLanes;
    const int64_t at = int64_t{bucket.tile} * kTilePixels + p;
    const PixelGradient d = gradients.pixel[at];
    const float d_depth = kDepth ? gradients.depth[at] : 0.0f;
    float2 state;
    if (bucket.bucket == 0) {
      const int x = bucket.tile % grid.columns * kDeviceTile + p % kDeviceTile;
      const int y = bucket.tile / grid.columns * kDeviceTile + p / kDeviceTile;
      state = {x < grid.width && y < grid.height ? 1.0f : 0.0f, d.total};
    } else {
      const int64_t place = (checkpoint + bucket.bucket) * kTilePixels + p;
      const PixelCheckpoint before = kept.checkpoint[place];
      float in_front = Dot(before.color, d.color);
      if constexpr (kDepth) in_front += kept.depth[place] * d_depth;
      state = {before.transmittance, d.total - in_front};
    }
    tile->d[p] = {d.color.x, d.color.y, d.color.z, d_depth};
    tile->state[p] = state;
  }
  if (lane < kSteps + 1 - kTilePixels) tile->state[kTilePixels + lane] = {0, 0};
}

template <bool kDepth>
__global__ void __launch_bounds__(kGroups* kLanes)
    Adjoint(TileListsView lists, const SplatRecord* record, const int32_t* first_slot,
            KeptTiles kept, TileGradients gradients, SlotSums* sums) {
  __shared__ alignas(16) char shared[kGroups * sizeof(TileState)];
  const int group = static_cast<int>(threadIdx.x) / kLanes;
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const unsigned mask = ((1u << kLanes) - 1) << (threadIdx.x % 32 / kLanes * kLanes);
  TileState* const tile = reinterpret_cast<TileState*>(shared) + group;
  const int64_t place = blockIdx.x * int64_t{kGroups} + group;
  if (place >= *kept.num_buckets) return;
  const TileBucket bucket = kept.bucket[place];
  const TileGrid& grid = lists.grid;
  const int column = bucket.tile % grid.columns, row = bucket.tile / grid.columns;
  const int first = lists.first[bucket.tile], end = lists.end[bucket.tile];
  LoadPixels<kDepth>(grid, bucket, FirstCheckpoint(bucket.tile, first), lane, kept, gradients,
                     tile);

  const int entry = first + bucket.bucket * kBucket + lane * kOfLane;
  TileSplat splat[kOfLane];
  int64_t slot[kOfLane];  // -1: no splat
  Sums sum[kOfLane];
#pragma unroll
  for (int k = 0; k < kOfLane; ++k) {
    slot[k] = -1;
    if (entry + k >= end) continue;
    const int32_t index = lists.splat[entry + k];
    const SplatRecord own = record[index];
    splat[k] = TileSplat(own, column * kDeviceTile, row * kDeviceTile);
    slot[k] = int64_t{first_slot[index]} + SplatTiles(own, grid).PlaceOf(column, row);
  }
  __syncwarp(mask);

  PixelState state{0, 0};
  int pixel = -lane;
  for (int step = 0; step < kSteps; ++step) {
    state.transmittance = __shfl_up_sync(mask, state.transmittance, 1, kLanes);
    state.behind = __shfl_up_sync(mask, state.behind, 1, kLanes);
    const float2 entering = tile->state[step];
    if (lane == 0) state = {entering.x, entering.y};
    const float4 d = tile->d[pixel & (kTilePixels - 1)];
    const float x = static_cast<float>(pixel & (kDeviceTile - 1));
    const float y = static_cast<float>(pixel >> 3);
#pragma unroll
    for (int k = 0; k < kOfLane; ++k) sum[k].Add<kDepth>(splat[k], x, y, d, &state);
    ++pixel;
  }
#pragma unroll
  for (int k = 0; k < kOfLane; ++k)
    if (slot[k] >= 0) sums[slot[k]] = sum[k].Unscaled();
}

}  // namespace

void AddTileAdjoints(const TileListsView& lists, const SplatRecord* record,
                     const int32_t* first_slot, const KeptTiles& kept, int64_t max_buckets,
                     const TileGradients& gradients, SlotSums* sums) {
  const unsigned blocks = static_cast<unsigned>((max_buckets + kGroups - 1) / kGroups);
  if (blocks == 0) return;
  if (gradients.depth != nullptr)
    Adjoint<true><<<blocks, kGroups * kLanes, 0, LaunchStream()>>>(
        lists, record, first_slot, kept, gradients, sums);
  else
    Adjoint<false><<<blocks, kGroups * kLanes, 0, LaunchStream()>>>(
        lists, record, first_slot, kept, gradients, sums);
  CheckLaunch("add_tile_adjoints");
}

#else

void AddTileAdjoints(const TileListsView&, const SplatRecord*, const int32_t*, const KeptTiles&,
                     int64_t, const TileGradients&, SlotSums*) {
  DeviceWait("splats");
}

#endif

}  // namespace regrade
