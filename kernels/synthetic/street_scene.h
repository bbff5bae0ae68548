// A street of 300 m: a scene for captures bigger than one machine.
#pragma once

#include <cstdint>
#include <utility>

#include "kernels/base/vec.h"
#include "kernels/synthetic/synthetic_scene.h"

namespace regrade {

// Two rows of houses along the x axis, and between them pavements with trees, lamps and
// benches, parked cars and a free roadway. Hills and clouds behind them leave no ray without a
// hit.
SyntheticScene MakeStreet(uint64_t seed);

// A camera's centre and a point that it looks at, at `turn` in [0, 1) of a way up one side of
// the roadway and back along the other.
std::pair<Vec3d, Vec3d> StreetViewpoint(double turn);

}  // namespace regrade
