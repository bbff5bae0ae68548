// Stage "reconstruct" of a run that was given a file of splats: the file is read in place of a
// fit.
#pragma once

#include "pipeline/run/run_context.h"
#include "pipeline/workspace/stage_runner.h"

namespace regrade {

// Writes field.npz: the file's splats in the field's frame, which poses and points decide as
// those of photos do; field_from_world leads back to the file's coordinates.
Stage GivenFieldStage(RunContext* context);

}  // namespace regrade
