// residual.npz: what a style adds at each voxel behind its network, see EQ(view-scale): f32
// "residual" [voxels, 3] in sRGB, and f32 "view_scale" [voxels, 3] in [0, 1] where it is not 1.
#pragma once

#include <cstdint>
#include <string>

#include "pipeline/fields/kept_records.h"
#include "stylize/field/voxel_residual.h"

namespace regrade {

// Colours below a quarter of a step of 255 become 0, which packs well. Throws
// Error(kResources).
void WriteResidualFile(const std::string& path, const VoxelResidual& residual);

// Those of `records`. Throws Error(kInput) for a file that is damaged, newer, or has another
// number of voxels than the field's file.
VoxelResidual ReadResidualFile(const std::string& path, const KeptRecords& records);

}  // namespace regrade
