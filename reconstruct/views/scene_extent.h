// Centre and radii of a scene of splats.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/vec.h"
#include "kernels/splats/splats.h"

namespace regrade {

// Sizes are in the units of the splats.
struct SplatExtent {
  Vec3d center;       // the median along each axis
  double radius = 1;  // of the ball around it with nine tenths of them; > 0
  double inner = 1;   // of the one with half of them; > 0
  double outer = 1;   // of the one with all but a fiftieth of them; > 0
};

enum class SplatWeight {
  kOpacity,
  kDetail,  // opacity over size: splats are small where photos show much of them, the middle of
            // interest
};

SplatExtent ExtentOf(const Splats& splats, SplatWeight by = SplatWeight::kOpacity);

// The middle one of the standard deviations, world units; finite.
double SizeOf(const Splat<float>& splat);

// Splats of less opacity than 0.3 show little by themselves.
inline constexpr float kOpaqueLogit = -0.85f;

// Indices of the splats of at least that opacity, in their order: all, or `most`, evenly
// spread.
std::vector<int64_t> OpaqueSplats(const SplatsView<float>& splats, int64_t most);

}  // namespace regrade
