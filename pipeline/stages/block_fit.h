// The fit of one block of a scene's field.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/stages/block_folder.h"

namespace regrade {

// Fits the splats that a block of the plan holds. They begin as those of `coarse`; those around
// them, of which neighbours that were made before are as they became, stay and are seen. Writes
// the splats that the block keeps and then its record; checkpoints are stage "block-K"'s.
// `views`: in the field's frame, with their gains. Throws as FitSplats, Interrupted after a
// checkpoint, and Error(kResources) where it takes more than --max-memory.
void FitBlock(const RunContext& context, const WorkingViews& views, const StoredField& coarse,
              const BlockFolder& folder, const BlockPlan& plan, int block,
              const ProgressFunction& progress);

}  // namespace regrade
