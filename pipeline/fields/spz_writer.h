// Writes Niantic's SPZ, whose layout spz.h has.
//
// Version 3: of 2026's readers all have it, and not all have version 4. A splat takes 20 bytes
// and 3 for each harmonic of a higher degree, before they are packed.
#pragma once

#include <string>

#include "kernels/splats/splats.h"

namespace regrade {

// `splats`: at least one, all usable, in the world of the cameras (right, down, front). They
// are turned to right, up and back, and written along MortonOrder. `antialiased`: fitted with
// Mip-Splatting's filter.
//
// Rounded are positions (in steps of at most 2^-22 of the farthest coordinate, limited to
// 2^23), logarithms of standard deviations (1/16, limited to [-10, 5.9]), opacities (1/255),
// colours (0.7 %), rotations (0.1 degrees), harmonics of degree 1 (1/32) and of others (1/16,
// both limited to [-1, 1]). Throws Error(kResources).
void WriteSpz(const std::string& path, const Splats& splats, bool antialiased);

}  // namespace regrade
