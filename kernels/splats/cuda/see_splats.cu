// Projects splats, a thread each, see SeeSplat.
#include "kernels/device/device_stream.h"
#include "kernels/splats/cuda/by_splat_basis.h"
#include "kernels/splats/cuda/own_splat.h"
#include "kernels/splats/cuda/see_splats.h"
#include "kernels/splats/cuda/seen_list.h"
#include "kernels/splats/seen_splat.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

constexpr int kBlock = 128;  // threads

// All but the colour; returns the number of tiles.
__device__ int SeeShape(const SplatsView<float>& splats, const SplatCamera& camera,
                        const SplatOptions& options, const TileGrid& grid, int64_t i,
                        SplatRecord* record) {
  OwnSplat<1> own;
  own.LoadShape(splats, i);
  if (!IsUsable(own.view(0), 0) || options.dropout.Drops(i)) return 0;
  SplatProjection<float> projection;
  if (!ProjectSplat(camera, options, own.values, &projection)) return 0;
  const ScreenEllipse<float>& ellipse = projection.ellipse;
  float reach;
  if (!SplatReach(own.values.opacity_logit, ellipse.filter * options.dropout.gain,
                  &record->log_opacity, &reach))
    return 0;
  record->u = ellipse.u, record->v = ellipse.v;
  record->c00 = ellipse.c00, record->c10 = ellipse.c10, record->c11 = ellipse.c11;
  record->z = static_cast<float>(projection.at.z);
  return SplatTiles(*record, grid).Count();
}

__global__ void __launch_bounds__(kBlock)
    See(SplatsView<float> splats, SplatCamera camera, SplatOptions options, TileGrid grid,
        SeenSplats seen) {
  const int64_t i = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (i >= splats.count) return;
  SplatRecord record;
  const int count = SeeShape(splats, camera, options, grid, i, &record);
  seen.num_tiles[i] = count;
  seen.z_bits[i] = count > 0 ? __float_as_uint(record.z) : kUnseen;
  seen.index[i] = static_cast<int32_t>(i);
  if (count > 0) seen.record[i] = record;
}

// Colours are most of a splat's bytes, and only those of splats that meet a tile are read.
template <int kBasis>
__global__ void __launch_bounds__(kBlock)
    Color(SplatsView<float> splats, Vec3d center, SeenSplats seen) {
  using List = SeenList<kBlock>;
  __shared__ uint16_t list[List::kChunk];
  const int count = List::Make(seen.num_tiles, splats.count, list);
  for (int k = static_cast<int>(threadIdx.x); k < count; k += kBlock) {
    const int64_t i = List::First() + list[k];
    OwnSplat<kBasis> own;
    own.LoadColor(splats, i);
    for (int a = 0; a < 3; ++a) own.values.mean[a] = splats.mean[3 * i + a];
    if (IsUsable(own.view(), 0)) {
      seen.record[i].color =
          SplatColor(kBasis, own.sh, DirectionToMean(center, own.values.mean).unit);
    } else {
      seen.num_tiles[i] = 0;
      seen.z_bits[i] = kUnseen;
    }
  }
}

}  // namespace

void SeeSplatsOnDevice(const SplatsView<float>& splats, const SplatCamera& camera,
                       const SplatOptions& options, const TileGrid& grid,
                       const SeenSplats& seen) {
  if (splats.count == 0) return;
  const unsigned blocks = static_cast<unsigned>((splats.count + kBlock - 1) / kBlock);
  See<<<blocks, kBlock, 0, LaunchStream()>>>(splats, camera, options, grid, seen);
  CheckLaunch("see_splats");
  if (splats.basis == 0) return;
  BySplatBasis(splats.basis, [&](auto basis) {
    Color<basis()><<<SeenList<kBlock>::Blocks(splats.count), kBlock, 0, LaunchStream()>>>(
        splats, camera.center, seen);
  });
  CheckLaunch("color_splats");
}

#else

void SeeSplatsOnDevice(const SplatsView<float>&, const SplatCamera&, const SplatOptions&,
                       const TileGrid&, const SeenSplats&) {
  DeviceWait("splats");
}

#endif

}  // namespace regrade
