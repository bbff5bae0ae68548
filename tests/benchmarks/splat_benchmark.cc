// Times pictures of random splats and their gradients on the CPU's fast path.
//
//   splat_benchmark [SPLATS [WIDTH HEIGHT]]
//
// 60000 splats and 480 x 360 pixels if nothing is given. Prints the best of five of each step
// in ms, and what the frame holds: entries (a splat in a tile) and pairs (a splat that a pixel
// composites).
#include <omp.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "kernels/splats/compositing.h"
#include "kernels/splats/cpu/render_splats.h"
#include "tests/support/small_splats.h"

namespace regrade {
namespace {

template <typename Work>
double BestOfFive(const Work& work) {
  double best = 1e30;
  for (int i = 0; i < 5; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    work();
    const std::chrono::duration<double, std::milli> took =
        std::chrono::steady_clock::now() - begin;
    best = std::min(best, took.count());
  }
  return best;
}

int64_t PairsOf(const SplatFrame& frame) {
  int64_t pairs = 0;
#pragma omp parallel for schedule(dynamic, 8) reduction(+ : pairs)
  for (int tile = 0; tile < frame.num_tiles(); ++tile) {
    const int x0 = tile % frame.tiles_x * kSplatTile, y0 = tile / frame.tiles_x * kSplatTile;
    for (int y = y0; y < std::min(y0 + kSplatTile, frame.camera.height); ++y)
      for (int x = x0; x < std::min(x0 + kSplatTile, frame.camera.width); ++x) {
        PixelState<float> state;
        for (int64_t e = frame.first_entry[static_cast<size_t>(tile)];
             e < frame.first_entry[static_cast<size_t>(tile) + 1]; ++e) {
          const SeenSplat<float>& splat =
              frame.seen[static_cast<size_t>(frame.entry_splat[static_cast<size_t>(e)])];
          SplatHit<float> hit;
          if (!HitSplat(splat.ellipse, splat.log_opacity, splat.reach, x, y, &hit)) continue;
          if (!CompositeSplat(hit.alpha, splat.color, splat.z, &state)) break;
          ++pairs;
        }
      }
  }
  return pairs;
}

int Run(int64_t count, int width, int height) {
  // About as large as neighbours are apart, as in a fitted scene.
  const double size = 0.25 / std::cbrt(static_cast<double>(count));
  const Splats splats =
      testing::CastSplats<float>(testing::RandomSplats(count, 16, 1, 1.2, size));
  const Camera camera = testing::SplatCameraOf(width, height);
  const SplatOptions options;
  SplatFrame frame = MakeSplatFrame(splats.view(), camera, options);
  std::printf("%lld splats, %zu seen, %zu entries, %lld pairs, %d threads\n",
              static_cast<long long>(count), frame.seen.size(), frame.entry_splat.size(),
              static_cast<long long>(PairsOf(frame)), omp_get_max_threads());
  const double sort =
      BestOfFive([&] { frame = MakeSplatFrame(splats.view(), camera, options); });
  for (const char* name : {"baseline", "avx2", "avx512"}) {
    const SplatTileFunctions* tiles = SplatTilesFor(name);
    if (tiles == nullptr) continue;
    SplatPicture<float> picture(width, height);
    const double forward = BestOfFive([&] { picture = RenderSplats(frame, *tiles); });
    const double backward = BestOfFive([&] { RenderSplatsAdjoint(frame, picture, *tiles); });
    std::printf("%-8s project and sort %6.1f ms, forward %6.1f ms, backward %6.1f ms\n", name,
                sort, forward, backward);
  }
  return 0;
}

}  // namespace
}  // namespace regrade

int main(int argc, char** argv) {
  return regrade::Run(argc > 1 ? std::atoll(argv[1]) : 60000,
                      argc > 3 ? std::atoi(argv[2]) : 480, argc > 3 ? std::atoi(argv[3]) : 360);
}
