#include "kernels/device/device_stream.h"
#include "kernels/splats/compositing.h"
#include "kernels/splats/cuda/device_math.h"
#include "kernels/splats/cuda/own_splat.h"
#include "kernels/splats/cuda/splat_record.h"
#include "kernels/splats/cuda/weigh_places.h"
#include "kernels/splats/projection.h"
#include "kernels/splats/splat_color.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

constexpr int kBlock = 64;  // threads

// False where the place does not see the splat.
__device__ bool HitAt(const Splat<float>& splat, const SplatCamera& camera,
                      const SplatOptions& options, const ViewPlace& place,
                      SplatHit<float>* hit) {
  SplatProjection<float> projection;
  if (!ProjectSplat(camera, options, splat, &projection)) return false;
  const ScreenEllipse<float>& ellipse = projection.ellipse;
  float log_opacity, reach;
  return SplatReach(splat.opacity_logit, ellipse.filter, &log_opacity, &reach) &&
         HitSplatAt(ellipse, log_opacity, reach, place.u, place.v, hit);
}

// For all lanes of a warp at once.
__device__ void Append(bool keeps, const SplatSample& sample, int64_t group,
                       const SplatSamplesView& samples) {
  const unsigned kept = __ballot_sync(kWholeWarp, keeps);
  if (kept == 0) return;
  const int lane = static_cast<int>(threadIdx.x % 32);
  int begin = 0;
  if (lane == 0) begin = atomicAdd(samples.count + group, __popc(kept));
  begin = __shfl_sync(kWholeWarp, begin, 0);
  const int64_t at = begin + __popc(kept & ((1u << lane) - 1));
  if (keeps && at < samples.capacity) samples.sample[group * samples.capacity + at] = sample;
}

// Blocks (x, y) take the rays of group y.
__global__ void __launch_bounds__(kBlock)
    Weigh(SplatsView<float> splats, SplatOptions options, const CameraLists* lists,
          int32_t only, PlaceGroups places, float min_weight, SplatSamplesView samples) {
  const int64_t ray = blockIdx.x * static_cast<int64_t>(kBlock) + threadIdx.x;
  const int64_t group = blockIdx.y;
  ViewPlace place{-1, 0, 0};
  if (ray < places.rays) place = places.place[group * places.rays + ray];
  const CameraLists* const own = lists + max(place.camera, 0);
  const bool chosen =
      place.camera >= 0 && own->first != nullptr && (only < 0 || place.camera == only);
  int at = 0, end = 0;
  if (chosen) {
    const int tile = static_cast<int>(place.v) / kDeviceTile * own->columns +
                     static_cast<int>(place.u) / kDeviceTile;
    at = own->first[tile];
    end = own->end[tile];
  }
  PixelState<float> state;
  while (__any_sync(kWholeWarp, at < end)) {
    bool keeps = false;
    SplatSample sample;
    if (at < end) {
      const int32_t k = own->splat[at++];
      OwnSplat<1> splat;
      splat.LoadShape(splats, k);
      SplatHit<float> hit;
      if (HitAt(splat.values, own->camera, options, place, &hit)) {
        const float weight = state.transmittance * hit.alpha;
        if (!CompositeSplat(hit.alpha, Vec3f{}, 0.0f, &state)) {
          at = end;  // the place sees no more
        } else if (weight > min_weight) {
          keeps = true;
          sample = {k, DirectionToMean(own->camera.center, splat.values.mean).unit, weight,
                    static_cast<int32_t>(ray)};
        }
      }
    }
    Append(keeps, sample, group, samples);
  }
  if (ray < places.rays && (chosen || place.camera < 0))
    samples.transmittance[group * places.rays + ray] = state.transmittance;
}

}  // namespace

void WeighPlaces(const SplatsView<float>& splats, const SplatOptions& options,
                 const CameraLists* lists, int32_t only, const PlaceGroups& places,
                 float min_weight, const SplatSamplesView& samples) {
  if (places.rays == 0 || places.groups == 0) return;
  const dim3 blocks(static_cast<unsigned>((places.rays + kBlock - 1) / kBlock),
                    static_cast<unsigned>(places.groups));
  Weigh<<<blocks, kBlock, 0, LaunchStream()>>>(splats, options, lists, only, places, min_weight,
                                               samples);
  CheckLaunch("weigh_places");
}

#else

void WeighPlaces(const SplatsView<float>&, const SplatOptions&, const CameraLists*, int32_t,
                 const PlaceGroups&, float, const SplatSamplesView&) {
  DeviceWait("splats");
}

#endif

}  // namespace regrade
