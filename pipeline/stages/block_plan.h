// How a scene's field is refined in blocks: the part of space of each, and the photos that see
// it.
#pragma once

#include <vector>

#include "kernels/device/backend.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/files/json_file.h"
#include "reconstruct/splats/space_blocks.h"

namespace regrade {

struct BlockPlan {
  std::vector<SpaceBlock> blocks;
  std::vector<std::vector<int>> views;  // [blocks]: training views that see what a block holds
};

// By small depth maps of the field at the training views. `views`: in the field's frame. Throws
// as DivideSpace.
BlockPlan PlanBlocks(const WorkingViews& views, const StoredField& coarse, int blocks,
                     Backend backend, const ProgressFunction& progress);

JsonValue PlanToJson(const BlockPlan& plan);
// Throws Error(kInput).
BlockPlan PlanFromJson(const JsonValue& json);

}  // namespace regrade
