// Which photos are worth matching, where their poses are known.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "kernels/scene/camera.h"

namespace regrade {

// Pairs (i, j), i < j, without repeats, in ascending order: each photo with up to kPartners
// that stand near and look the same way, the nearest few, and ever fewer of those farther off,
// for the width of their angles. Of up to 2 kPartners photos, all pairs.
inline constexpr size_t kPartners = 6;
std::vector<std::pair<size_t, size_t>> PairsWorthMatching(const std::vector<Camera>& cameras);

}  // namespace regrade
