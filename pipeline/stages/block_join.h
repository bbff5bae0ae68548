// The field of all blocks.
#pragma once

#include "pipeline/stages/block_folder.h"

namespace regrade {

// What is near a seam: pixels, both ways.
inline constexpr int kSeamPixels = 8;

// Writes field.npz of the blocks' splats, measures it beside the one that it replaces, and
// notes both in the record of stage "reconstruct", whose inputs stay; removes the blocks. The
// stages of styles, which were made of the old field, are forgotten. Throws Error(kInput),
// which names the blocks that are missing.
void JoinBlocks(RunContext* context, const BlockFolder& folder);

}  // namespace regrade
