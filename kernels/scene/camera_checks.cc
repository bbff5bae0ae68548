#include "kernels/scene/camera_checks.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"

namespace regrade {

std::string ImplausibleCamera(const Camera& camera) {
  constexpr double kLargestTranslation = 1e12;  // world units
  const double side = std::max(camera.width, camera.height);
  for (const double f : {camera.fx, camera.fy})
    if (!(f > 0.05 * side && f < 100 * side))
      return Format("the focal length %g px for a picture of %d x %d", f, camera.width,
                    camera.height);
  if (!(camera.cx >= 0 && camera.cx <= camera.width && camera.cy >= 0 &&
        camera.cy <= camera.height))
    return "its principal point outside the picture";
  for (const double coefficient : camera.distortion)
    if (!std::isfinite(coefficient)) return "a distortion that is not a finite number";
  for (int i = 0; i < 3; ++i)
    if (!(std::abs(camera.camera_from_world.translation[i]) <= kLargestTranslation))
      return "a position at infinity";
  return "";
}

bool IsSound(const Similarity& s) {
  constexpr double kTolerance = 1e-3;
  const Mat3d gram = s.rotation.Transposed() * s.rotation;
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(s.translation[i])) return false;
    for (int j = 0; j < 3; ++j)
      if (!(std::abs(gram(i, j) - (i == j)) <= kTolerance)) return false;
  }
  return std::isfinite(s.scale) && s.scale > 0 && s.rotation.Determinant() > 0;
}

}  // namespace regrade
