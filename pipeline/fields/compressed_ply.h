// PlayCanvas' compressed PLY (playcanvas/engine and splat-transform; SuperSplat writes it).
//
// Element chunk, one for each 256 vertices: floats min_x.. max_z, min_scale_x.. max_scale_z
// (logarithms), and in newer files min_r.. max_b. Element vertex, uint: packed_position and
// packed_scale (11, 10 and 11 bits of x, y and z between the chunk's bounds), packed_rotation
// (2 bits: which of w x y z is largest; then 10 bits for each of the others, of [-1, 1] /
// sqrt(2)), packed_color (8 bits each: red, green and blue, between the chunk's bounds if it
// has some, as 1/2 + the first harmonic's part; opacity). Element sh, if there is one: uchar
// f_rest_*, [0, 256) of [-4, 4). Axes as in a PLY of Gaussians.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "pipeline/fields/ply_header.h"
#include "pipeline/fields/splat_scene.h"

namespace regrade {

bool IsCompressedPly(const PlyHeader& header);

// The whole file. Throws Error(kInput), see ReadSplats.
SplatScene ReadCompressedPly(std::string_view bytes, const PlyHeader& header, uint64_t budget,
                             const std::string& where);

}  // namespace regrade
