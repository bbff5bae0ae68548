// Selects the pairs of photos to match when their poses are known.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "kernels/scene/camera.h"

namespace regrade {

// Unique pairs (i, j), i < j, in ascending order: each photo with up to kPartners similar
// views, mostly the nearest, and some farther away for wider triangulation angles. All pairs
// for up to 2 kPartners photos.
inline constexpr size_t kPartners = 6;
std::vector<std::pair<size_t, size_t>> PairsToMatch(const std::vector<Camera>& cameras);

}  // namespace regrade
