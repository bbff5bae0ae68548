// The nearest neighbours of each of many points.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/vec.h"

namespace regrade {

// [points, count]: of each point `count` others, nearest first, of equally near ones that of
// the lower index; -1 where there are no more. Exact, by a k-d tree; coordinates are finite.
// The same for any number of threads.
std::vector<int32_t> NearestPoints(const std::vector<Vec3f>& points, int count);

}  // namespace regrade
