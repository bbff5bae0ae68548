// Writes PlayCanvas' compressed PLY, whose layout compressed_ply.h has.
#pragma once

#include <string>

#include "kernels/splats/splats.h"

namespace regrade {

// `splats`: at least one, all usable, in the world of the cameras. Written along MortonOrder,
// so that the splats of a chunk are near each other: 16 bytes each, 72 for 256 of them, and one
// for each harmonic of a higher degree. `antialiased`: fitted with Mip-Splatting's filter,
// which a comment says. `comment`: a line of the header.
//
// Rounded are positions and logarithms of standard deviations (limited to [-20, 20]) in steps
// of a 1023rd or 2047th of what a chunk spans, colours of a 255th of it, opacities of 1/255,
// rotations (0.1 degrees), harmonics (1/32, limited to [-4, 4]). Throws Error(kResources).
void WriteCompressedPly(const std::string& path, const Splats& splats, bool antialiased,
                        const std::string& comment);

}  // namespace regrade
