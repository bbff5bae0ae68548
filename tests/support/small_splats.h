// Random splats in front of a small camera, for tests of their pictures.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/base/random.h"
#include "kernels/scene/camera.h"
#include "kernels/splats/covariance.h"
#include "kernels/splats/splats.h"

namespace regrade::testing {

// Uniform in [lo, hi), keyed by two counters.
inline double Draw(uint64_t seed, uint64_t item, uint64_t part, double lo, double hi) {
  return lo + (hi - lo) * RandomDouble(seed, item, part);
}

// At (0.4, -0.3, -3.2), turned by a few degrees, its principal point off the middle.
inline Camera SplatCameraOf(int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = 1.1 * width;
  camera.fy = 1.15 * width;
  camera.cx = 0.47 * width;
  camera.cy = 0.54 * height;
  const double turn[4] = {1, 0.04, -0.06, 0.03};
  camera.camera_from_world.rotation = RotationOf(turn);
  camera.camera_from_world.translation =
      -(camera.camera_from_world.rotation * Vec3d{0.4, -0.3, -3.2});
  return camera;
}

// Around the origin, within `spread`; scales from `small` to 8 times that.
inline SplatArrays<double> RandomSplats(int64_t count, int basis, uint64_t seed,
                                        double spread = 1.2, double small = 0.06) {
  SplatArrays<double> splats(count, basis);
  for (int64_t i = 0; i < count; ++i) {
    const uint64_t item = static_cast<uint64_t>(i);
    Splat<double> splat;
    for (uint64_t a = 0; a < 3; ++a) {
      splat.mean[static_cast<int>(a)] = Draw(seed, item, a, -spread, spread);
      splat.log_scale[static_cast<int>(a)] =
          std::log(small) + Draw(seed, item, 3 + a, 0, std::log(8.0));
    }
    for (uint64_t a = 0; a < 4; ++a) splat.quaternion[a] = Draw(seed, item, 6 + a, -2, 2);
    splat.opacity_logit = Draw(seed, item, 10, -3, 3);
    splats.Set(i, splat);
    for (int k = 0; k < 3 * basis; ++k)
      splats.sh[static_cast<size_t>(3 * basis * i + k)] =
          Draw(seed, item, 11 + static_cast<uint64_t>(k), -0.5, 0.7);
  }
  splats.background = {0.3, 0.6, 0.2};
  return splats;
}

template <typename To, typename From>
SplatArrays<To> CastSplats(const SplatArrays<From>& from) {
  const auto cast = [](const std::vector<From>& values) {
    return std::vector<To>(values.begin(), values.end());
  };
  SplatArrays<To> to;
  to.mean = cast(from.mean);
  to.log_scale = cast(from.log_scale);
  to.quaternion = cast(from.quaternion);
  to.opacity_logit = cast(from.opacity_logit);
  to.sh = cast(from.sh);
  to.basis = from.basis;
  to.background = from.background.template Cast<To>();
  return to;
}

// The values of a float splat, in double.
inline SplatArrays<double> RoundedToFloat(const SplatArrays<double>& splats) {
  return CastSplats<double>(CastSplats<float>(splats));
}

}  // namespace regrade::testing
