// Runs the stages of a run in their order, from photos to a report.
#pragma once

#include <string>

#include "pipeline/run/run_context.h"

namespace regrade {

// Runs the stages from `first` to `last` (names of kStageNames); each reads the results of
// earlier ones from disk. Stages before `first` must be done. Throws what stages throw.
void RunPipeline(const std::string& first, const std::string& last, RunContext* context);

}  // namespace regrade
