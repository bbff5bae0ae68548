// Photos of a synthetic scene with two known regions, and style pictures that look like one
// each.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/base/random.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "kernels/synthetic/ray_trace.h"
#include "kernels/synthetic/synthetic_scene.h"
#include "tests/support/pictures.h"

namespace regrade::testing {

struct TwoRegions {
  std::vector<Image> photos;
  std::vector<Image> sky;  // [H, W, 1]: the share of each pixel that is of the first region
};

// The still life whose tiled wall became a sky, blue with white, and whose rest is the ground,
// brown and ochre: each keeps a third of its own paint's contrast.
inline TwoRegions SkyAndGround(int views, int width, int height) {
  const SyntheticScene scene = MakeSyntheticScene("table", 0);
  const auto wall = std::ranges::find(scene.solids, Shape::kBackdrop, &Solid::shape);
  const int index = static_cast<int>(wall - scene.solids.begin());
  TwoRegions regions;
  for (const Camera& camera : SyntheticCameras(scene, views, width, height)) {
    Image color = RenderSyntheticView(scene, camera).color;
    Image mask = RenderSolidMask(scene, camera, index);
    for (int64_t i = 0; i < color.num_pixels(); ++i) {
      float* const p = &color.pixels[static_cast<size_t>(3 * i)];
      const double sky = double{mask.pixels[static_cast<size_t>(i)]};
      const Vec3d to = Vec3d{0.45, 0.65, 0.9} * sky + Vec3d{0.5, 0.36, 0.2} * (1 - sky);
      for (int c = 0; c < 3; ++c)
        p[c] = static_cast<float>(std::clamp(to[c] + (double{p[c]} - 0.5) / 3, 0.0, 1.0));
    }
    regions.photos.push_back(std::move(color));
    regions.sky.push_back(std::move(mask));
  }
  return regions;
}

// A sky at dusk and a wall of red brick: other colours, but each nearer to its region.
inline std::vector<Image> SkyAndGroundStyles() {
  Image sky(120, 80), wall(90, 120);
  for (int y = 0; y < sky.height; ++y)
    for (int x = 0; x < sky.width; ++x) {
      const double cloud = 0.08 * std::sin(0.1 * x + 0.2 * y) + 0.05 * std::cos(0.23 * y);
      for (int c = 0; c < 3; ++c)
        sky.at(x, y)[c] =
            static_cast<float>(std::clamp(Vec3d{0.32, 0.42, 0.8}[c] + cloud, 0.0, 1.0));
    }
  for (int y = 0; y < wall.height; ++y)
    for (int x = 0; x < wall.width; ++x) {
      const bool mortar = y % 12 < 2 || (x + (y / 12 % 2) * 10) % 20 < 2;
      const double grain =
          0.1 * (RandomDouble(3, 0, static_cast<uint64_t>(y) * wall.width + x) - 0.5);
      for (int c = 0; c < 3; ++c)
        wall.at(x, y)[c] = static_cast<float>(std::clamp(
            (mortar ? Vec3d{0.6, 0.5, 0.4} : Vec3d{0.6, 0.28, 0.14})[c] + grain, 0.0, 1.0));
    }
  return {sky, wall};
}

}  // namespace regrade::testing
