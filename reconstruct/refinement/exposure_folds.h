// Parts of a scene that err together, for a check that leaves them out in turn.
#pragma once

#include <vector>

#include "kernels/base/vec.h"

namespace regrade {

// A part's number in [0, 2^levels) for each place: cut at the median of the widest axis (from
// the tenth to the ninetieth percentile, so that strays have no say), and again each half. Free
// of the places' order, up to the names of parts and places that coincide.
std::vector<int> SpatialFolds(const std::vector<Vec3d>& places, int levels);

}  // namespace regrade
