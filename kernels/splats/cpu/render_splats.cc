#include "kernels/splats/cpu/render_splats.h"

#include <vector>

#include "kernels/base/error.h"

namespace regrade {
namespace {

void Add(const SplatSums<float>& more, SplatSums<double>* sums) {
  for (int a = 0; a < 2; ++a) sums->ellipse.h[a] += more.ellipse.h[a];
  for (int a = 0; a < 3; ++a) sums->ellipse.H[a] += more.ellipse.H[a];
  sums->ellipse.f += more.ellipse.f;
  sums->color += more.color.Cast<double>();
  sums->z += more.z;
}

}  // namespace

SplatPicture<float> RenderSplats(const SplatFrame& frame, const SplatTileFunctions& tiles) {
  SplatPicture<float> picture(frame.camera.width, frame.camera.height);
#pragma omp parallel for schedule(dynamic, 1)
  for (int tile = 0; tile < frame.num_tiles(); ++tile) tiles.render(frame, tile, &picture);
  return picture;
}

SplatArrays<float> RenderSplatsAdjoint(const SplatFrame& frame,
                                       const SplatPicture<float>& d_picture,
                                       const SplatTileFunctions& tiles) {
  REGRADE_CHECK(d_picture.width == frame.camera.width &&
                d_picture.height == frame.camera.height);
  std::vector<SplatSums<float>> sums(frame.entry_slot.size());
  std::vector<Vec3f> d_background(static_cast<size_t>(frame.num_tiles()));
  SplatArrays<float> gradient(frame.splats.count, frame.splats.basis);
#pragma omp parallel
  {
    SplatTape tape;
#pragma omp for schedule(dynamic, 1)
    for (int tile = 0; tile < frame.num_tiles(); ++tile)
      tiles.adjoint(frame, tile, d_picture, &tape, sums.data(),
                    &d_background[static_cast<size_t>(tile)]);
#pragma omp for schedule(static)
    for (int64_t k = 0; k < static_cast<int64_t>(frame.seen.size()); ++k) {
      const size_t at = static_cast<size_t>(k);
      SplatSums<double> total;
      for (int64_t s = frame.first_slot[at]; s < frame.first_slot[at + 1]; ++s)
        Add(sums[static_cast<size_t>(s)], &total);
      const int64_t i = frame.seen[at].index;
      Splat<float> d{};
      SeeSplatAdjoint(frame.camera, frame.options, frame.splats, frame.seen[at], total, &d,
                      &gradient.sh[static_cast<size_t>(3 * frame.splats.basis * i)]);
      gradient.Set(i, d);
    }
  }
  Vec3d background{};
  for (const Vec3f& tile : d_background) background += tile.Cast<double>();
  gradient.background = background.Cast<float>();
  return gradient;
}

}  // namespace regrade
