// Where the splats of a scene are that is not known otherwise.
#pragma once

#include <cstdint>
#include <vector>

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

// Splats of less opacity than 0.3 show little by themselves.
inline constexpr float kOpaqueLogit = -0.85f;

// Indices of the splats of at least that opacity, in their order: all, or `most`, evenly
// spread.
std::vector<int64_t> OpaqueSplats(const SplatsView<float>& splats, int64_t most);

}  // namespace regrade
