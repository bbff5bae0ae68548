// Composites a tile by a warp, two pixels a thread.
#include "kernels/device/device_stream.h"
#include "kernels/splats/cuda/composite_tiles.h"
#include "kernels/splats/cuda/device_math.h"
#include "kernels/splats/cuda/tile_splat.h"
#include "kernels/splats/splat_camera.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

constexpr int kWarps = 2;  // of a block
constexpr int kCheck = 8;  // entries after which a tile may end

// A pixel on its way through the splats.
struct Running {
  float transmittance;  // negative once the pixel has ended
  float depth = 0, median_depth = 0;
  Vec3f color;

  __device__ explicit Running(bool inside) : transmittance(inside ? 1.0f : -1.0f), color() {}
  __device__ bool alive() const { return transmittance > 0; }

  // See CompositeSplat and HitSplat.
  template <bool kDepth>
  __device__ void Composite(const TileSplat& splat, float exponent) {
    const float alpha =
        TileSplat::Sees(exponent) ? fminf(FastExp2(exponent), float(kMaxAlpha)) : 0.0f;
    const float t = transmittance, after = t * (1 - alpha);
    const bool stays = after >= float(kMinTransmittance);
    const float weight = stays ? t * alpha : 0.0f;
    color.x = fmaf(weight, splat.color.x, color.x);
    color.y = fmaf(weight, splat.color.y, color.y);
    color.z = fmaf(weight, splat.color.z, color.z);
    if constexpr (kDepth) {
      depth = fmaf(weight, splat.z, depth);
      if (stays && t > 0.5f && !(after > 0.5f)) median_depth = splat.z;
    }
    transmittance = stays ? after : -fabsf(t);
  }
};

template <bool kDepth>
__device__ void Write(const Running& pixel, const Vec3f& background, int64_t at,
                      const SplatPixels<float>& pixels) {
  const float t = fabsf(pixel.transmittance);
  pixels.color[3 * at] = pixel.color.x + background.x * t;
  pixels.color[3 * at + 1] = pixel.color.y + background.y * t;
  pixels.color[3 * at + 2] = pixel.color.z + background.z * t;
  pixels.transmittance[at] = t;
  if constexpr (kDepth) {
    pixels.depth[at] = pixel.depth;
    pixels.median_depth[at] = pixel.median_depth;
  }
}

template <bool kDepth>
__device__ void Keep(const Running& pixel, int64_t at, const KeptTiles& kept) {
  kept.checkpoint[at] = {fmaxf(pixel.transmittance, 0), pixel.color};
  if (kDepth && kept.depth != nullptr) kept.depth[at] = pixel.depth;
}

// Thread l of a warp has the tile's pixels l and l + 32, by rows.
template <bool kDepth, bool kKeep>
__global__ void __launch_bounds__(32 * kWarps)
    Composite(TileListsView lists, const SplatRecord* record, Vec3f background,
              SplatPixels<float> pixels, KeptTiles kept) {
  __shared__ alignas(16) char shared[kWarps][kBucket * sizeof(TileSplat)];
  const int lane = static_cast<int>(threadIdx.x % 32);
  TileSplat* const splats = reinterpret_cast<TileSplat*>(shared[threadIdx.x / 32]);
  const TileGrid& grid = lists.grid;
  const int tile = static_cast<int>(blockIdx.x * kWarps + threadIdx.x / 32);
  if (tile >= grid.count()) return;
  const int left = tile % grid.columns * kDeviceTile, top = tile / grid.columns * kDeviceTile;
  const int column = lane % kDeviceTile, row = lane / kDeviceTile;
  constexpr int kApart = 32 / kDeviceTile;  // rows between a thread's pixels
  const float x = static_cast<float>(column), y = static_cast<float>(row);
  const bool inside = left + column < grid.width;
  Running one(inside && top + row < grid.height);
  Running two(inside && top + row + kApart < grid.height);

  const int first = lists.first[tile], end = lists.end[tile];
  const int32_t checkpoint = FirstCheckpoint(tile, first);
  int buckets = 0;
  int32_t next = first + lane < end ? lists.entry[first + lane].splat : 0;
  for (int at = first; at < end; at += kBucket) {
    if (!__any_sync(kWholeWarp, one.alive() || two.alive())) break;
    if constexpr (kKeep) {
      const int64_t place = int64_t{checkpoint + buckets} * kTilePixels + lane;
      Keep<kDepth>(one, place, kept);
      Keep<kDepth>(two, place + 32, kept);
    }
    ++buckets;
    const int count = min(kBucket, end - at);
    __syncwarp();
    if (lane < count) splats[lane] = TileSplat(record[next], left, top);
    __syncwarp();
    if (at + kBucket + lane < end) next = lists.entry[at + kBucket + lane].splat;
    for (int base = 0; base < count; base += kCheck) {
      const int stop = min(base + kCheck, count);
#pragma unroll 4
      for (int k = base; k < stop; ++k) {
        const TileSplat splat = splats[k];
        const float across = splat.Across(x), slant = splat.Slant(x);
        one.Composite<kDepth>(splat, splat.Exponent(across, splat.Along(slant, y)));
        two.Composite<kDepth>(splat, splat.Exponent(across, splat.Along(slant, y + kApart)));
      }
      if (!__any_sync(kWholeWarp, one.alive() || two.alive())) break;
    }
  }

  if (inside) {
    const int64_t at = int64_t{top + row} * grid.width + left + column;
    if (top + row < grid.height) Write<kDepth>(one, background, at, pixels);
    if (top + row + kApart < grid.height)
      Write<kDepth>(two, background, at + int64_t{kApart} * grid.width, pixels);
  }
  if constexpr (kKeep) {
    if (buckets == 0) return;
    int at = 0;
    if (lane == 0) at = atomicAdd(kept.num_buckets, buckets);
    at = __shfl_sync(kWholeWarp, at, 0);
    for (int b = lane; b < buckets; b += 32)
      kept.bucket[at + b] = {tile, first + b * kBucket, min(first + (b + 1) * kBucket, end),
                             checkpoint + b};
  }
}

}  // namespace

void CompositeTiles(const TileListsView& lists, const SplatRecord* record,
                    const Vec3f& background, const SplatPixels<float>& pixels,
                    const KeptTiles& kept) {
  const unsigned blocks = static_cast<unsigned>((lists.grid.count() + kWarps - 1) / kWarps);
  const auto launch = [&](auto depth, auto keep) {
    Composite<depth(), keep()>
        <<<blocks, 32 * kWarps, 0, LaunchStream()>>>(lists, record, background, pixels, kept);
  };
  const bool depth = pixels.depth != nullptr;
  if (depth && kept.on())
    launch(std::true_type(), std::true_type());
  else if (depth)
    launch(std::true_type(), std::false_type());
  else if (kept.on())
    launch(std::false_type(), std::true_type());
  else
    launch(std::false_type(), std::false_type());
  CheckLaunch("composite_tiles");
}

#else

void CompositeTiles(const TileListsView&, const SplatRecord*, const Vec3f&,
                    const SplatPixels<float>&, const KeptTiles&) {
  DeviceWait("splats");
}

#endif

}  // namespace regrade
