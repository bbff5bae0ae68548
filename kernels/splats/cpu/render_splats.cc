#include "kernels/splats/cpu/render_splats.h"

#include <algorithm>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {

void RenderSplats(const SplatFrame& frame, SplatPicture<float>* picture,
                  const SplatTileFunctions& tiles) {
  REGRADE_CHECK(picture->width == frame.camera.width && picture->height == frame.camera.height);
#pragma omp parallel for schedule(dynamic, 1)
  for (int tile = 0; tile < frame.num_tiles(); ++tile) tiles.render(frame, tile, picture);
}

SplatPicture<float> RenderSplats(const SplatFrame& frame, const SplatTileFunctions& tiles) {
  SplatPicture<float> picture(frame.camera.width, frame.camera.height);
  RenderSplats(frame, &picture, tiles);
  return picture;
}

void SumOverTiles(const SplatFrame& frame, const SplatPicture<float>& d_picture,
                  SplatTileSums* sums, const SplatTileFunctions& tiles) {
  REGRADE_CHECK(d_picture.width == frame.camera.width &&
                d_picture.height == frame.camera.height);
  const int64_t slots = frame.first_slot.back();
  sums->of_slot.Clear();
  sums->of_slot.Resize(slots);
  std::vector<Vec3f> d_background(static_cast<size_t>(frame.num_tiles()));
#pragma omp parallel
  {
    SplatTape tape;
#pragma omp for schedule(dynamic, 1)
    for (int tile = 0; tile < frame.num_tiles(); ++tile)
      tiles.adjoint(frame, tile, d_picture, &tape, sums->of_slot.data(),
                    &d_background[static_cast<size_t>(tile)]);
  }
  Vec3d background{};
  for (const Vec3f& tile : d_background) background += tile.Cast<double>();
  sums->d_background = background.Cast<float>();
}

SplatArrays<float> RenderSplatsAdjoint(const SplatFrame& frame,
                                       const SplatPicture<float>& d_picture,
                                       const SplatTileFunctions& tiles) {
  SplatTileSums sums;
  SumOverTiles(frame, d_picture, &sums, tiles);
  const int values = 3 * frame.splats.basis;
  SplatArrays<float> gradient(frame.splats.count, frame.splats.basis);
  ForEachGradient(frame, sums, [&](int64_t i, const Splat<float>& d, const float* d_sh) {
    gradient.Set(i, d);
    std::copy_n(d_sh, values, &gradient.sh[static_cast<size_t>(values) * i]);
  });
  gradient.background = sums.d_background;
  return gradient;
}

}  // namespace regrade
