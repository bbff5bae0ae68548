// Which direction is up in splats whose cameras are not known.
#pragma once

#include <string>

#include "kernels/base/vec.h"
#include "kernels/splats/splats.h"

namespace regrade {

struct SceneUp {
  Vec3d up;         // unit length
  std::string why;  // "y points down, as programs of splats write it, and ..."
};

// Files have y down, z up or y up by the program that wrote them, and are tilted by some
// degrees. Up is the first of these whose ground is there: many flat splats whose axis is near
// that direction, low in the scene; it is then the mean of their axes. Without a ground it is
// -y.
SceneUp EstimateUp(const Splats& splats);

}  // namespace regrade
