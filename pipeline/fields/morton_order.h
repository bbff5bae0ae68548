// The order of splats along a curve that keeps neighbours together.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/splats/splats.h"

namespace regrade {

// Indices of all splats along Morton's curve through the box of their means, whose axes are
// divided by 2^20. A function of the means alone: styles of one scene have one order.
std::vector<int64_t> MortonOrder(const SplatsView<float>& splats);

}  // namespace regrade
