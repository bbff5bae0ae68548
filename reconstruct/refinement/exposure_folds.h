// Divides a scene into spatial parts for cross-validation.
#pragma once

#include <vector>

#include "kernels/base/vec.h"

namespace regrade {

// The part of each position, in [0, 2^levels): splits at the median of the widest axis
// (measured from the 10th to the 90th percentile, to ignore outliers), recursively. Independent
// of the order of positions, except for those that coincide.
std::vector<int> SpatialFolds(const std::vector<Vec3d>& positions, int levels);

}  // namespace regrade
