// Where the splats of a scene are that is not known otherwise.
#pragma once

#include "kernels/base/vec.h"
#include "kernels/splats/splats.h"

namespace regrade {

// Sizes are in the units of the splats. Splats count by their opacity.
struct SplatExtent {
  Vec3d center;       // the median along each axis
  double radius = 1;  // of the ball around it with nine tenths of them; > 0
  double inner = 1;   // of the one with half of them; > 0
  double outer = 1;   // of the one with all but a fiftieth of them; > 0
};

SplatExtent ExtentOf(const Splats& splats);

}  // namespace regrade
