// The records of 32 bytes that antimatter15's viewer reads (.splat; antimatter15/splat,
// convert.py): position and standard deviations (6 floats, little-endian), red, green, blue and
// opacity (4 bytes of [0, 1]), rotation (w x y z, 4 bytes of [-1, 1)). They have no mark and no
// harmonics. Axes as in a PLY of Gaussians.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "pipeline/fields/splat_scene.h"

namespace regrade {

// Whether the bytes are whole records, the first of which have places and sizes that a splat
// can have.
bool LooksLikeDotSplat(std::string_view bytes);

// The whole file. Throws Error(kInput), see ReadSplats.
SplatScene ReadDotSplat(std::string_view bytes, uint64_t budget, const std::string& where);

}  // namespace regrade
