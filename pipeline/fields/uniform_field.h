// A field sampled on a uniform grid over the same box: for programs that read no cells.
#pragma once

#include <cstdint>

#include "kernels/field/radiance_field.h"

namespace regrade {

inline constexpr int kMostUniformVoxels =
    512;  // along an axis, where nothing else is asked for

// Vertices per axis of a grid with `longest` of them on the longest side, in the proportions of
// the field's own. 0: the field's own resolution; of an adaptive field that of the finest
// level, up to kMostUniformVoxels.
Vec3i UniformResolution(const RadianceField& field, int longest);

// At each vertex the field's blend (EQ(trilinear)); nothing is stored where no cell is, and of
// a uniform grid where no corner of the cell is. Background spheres are kept. Throws
// Error(kResources) where the result takes more than `memory` bytes.
RadianceField ToUniform(const RadianceField& field, const Vec3i& resolution, uint64_t memory);

}  // namespace regrade
