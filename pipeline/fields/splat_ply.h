// Splats as a PLY file in the layout of Kerbl et al.'s program, which viewers and editors of
// splats open.
//
// Binary, little-endian floats by splat: x y z, nx ny nz (0), f_dc_0..2, f_rest_* (the other
// harmonics of red, then green, then blue), opacity (its logit), scale_0..2 (logarithms),
// rot_0..3 (w x y z). A colour is max(0, 1/2 + sum), see EQ(splat-color).
#pragma once

#include <string>

#include "pipeline/fields/field_file.h"

namespace regrade {

// In the capture's world: places, sizes, rotations and harmonics go through the inverse of
// `field_from_world`. `comment` is a line of the header. `stored` has splats. Throws
// Error(kResources).
void WriteSplatPly(const std::string& path, const StoredField& stored,
                   const std::string& comment);

}  // namespace regrade
