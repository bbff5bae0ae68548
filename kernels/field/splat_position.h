// A splat's position in the box, contracted outside it.
#pragma once

#include <cmath>

#include "kernels/base/vec.h"
#include "kernels/field/grid_frame.h"

namespace regrade {

// EQ(splat-position): of splats p = (mean - centre) / radius of the box, along each axis, and
// where m = max |p_a| > 1, p (2 - 1 / m) / m: what lies far outside stays within [-2, 2].
HD inline Vec3f SplatPosition(const GridFrame& box, const Vec3f& mean) {
  using std::abs;
  Vec3f p;
  float farthest = 0;
  for (int a = 0; a < 3; ++a) {
    p[a] = (mean[a] - box.center[a]) / box.radius[a];
    farthest = abs(p[a]) > farthest ? abs(p[a]) : farthest;
  }
  return farthest <= 1 ? p : p / farthest * (2 - 1 / farthest);
}

}  // namespace regrade
