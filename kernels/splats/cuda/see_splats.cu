// Projects splats, a thread each, see SeeSplat.
#include "kernels/splats/cuda/see_splats.h"

#include "kernels/device/device_stream.h"
#include "kernels/device/launch_size.h"
#include "kernels/splats/cuda/by_splat_basis.h"
#include "kernels/splats/cuda/own_splat.h"
#include "kernels/splats/seen_splat.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

// The colour is read last, of splats that meet a tile: it is most of a splat's bytes.
template <int kBasis>
__device__ int SeeOne(const SplatsView<float>& splats, const SplatCamera& camera,
                      const SplatOptions& options, const TileGrid& grid, int64_t i,
                      SplatRecord* record) {
  OwnSplat<kBasis> own;
  own.LoadShape(splats, i);
  if (!IsUsable(own.view(0), 0)) return 0;
  SplatProjection<float> projection;
  if (!ProjectSplat(camera, options, own.values, &projection)) return 0;
  const ScreenEllipse<float>& ellipse = projection.ellipse;
  float reach;
  if (!SplatReach(own.values.opacity_logit, ellipse.filter, &record->log_opacity, &reach))
    return 0;
  record->u = ellipse.u, record->v = ellipse.v;
  record->c00 = ellipse.c00, record->c10 = ellipse.c10, record->c11 = ellipse.c11;
  record->z = static_cast<float>(projection.at.z);
  const int count = SplatTiles(*record, grid).Count();
  if (count == 0) return 0;
  own.LoadColor(splats, i);
  if (!IsUsable(own.view(), 0)) return 0;
  record->color = SplatColor(kBasis, own.sh,
                             DirectionToMean(camera.center, own.values.mean).unit);
  return count;
}

template <int kBasis>
__global__ void __launch_bounds__(kThreads)
    See(SplatsView<float> splats, SplatCamera camera, SplatOptions options, TileGrid grid,
        SeenSplats seen) {
  const int64_t i = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (i >= splats.count) return;
  SplatRecord record;
  const int count = SeeOne<kBasis>(splats, camera, options, grid, i, &record);
  seen.num_tiles[i] = count;
  seen.z_bits[i] = count > 0 ? __float_as_uint(record.z) : kUnseen;
  seen.index[i] = static_cast<int32_t>(i);
  if (count > 0) seen.record[i] = record;
}

}  // namespace

void SeeSplatsOnDevice(const SplatsView<float>& splats, const SplatCamera& camera,
                       const SplatOptions& options, const TileGrid& grid,
                       const SeenSplats& seen) {
  if (splats.count == 0) return;
  BySplatBasis(splats.basis, [&](auto basis) {
    See<basis()><<<BlocksFor(splats.count), kThreads, 0, LaunchStream()>>>(
        splats, camera, options, grid, seen);
  });
  CheckLaunch("see_splats");
}

#else

void SeeSplatsOnDevice(const SplatsView<float>&, const SplatCamera&, const SplatOptions&,
                       const TileGrid&, const SeenSplats&) {
  DeviceWait("splats");
}

#endif

}  // namespace regrade
