// The whole road from photos to a report, stage by stage.
#pragma once

#include <string>

#include "pipeline/run/run_context.h"

namespace regrade {

// Does the stages from `first` to `last` (names of kStageNames), each from the results of the
// one before on disk. Stages before `first` must have been done. Throws what stages throw.
void RunPipeline(const std::string& first, const std::string& last, RunContext* context);

}  // namespace regrade
