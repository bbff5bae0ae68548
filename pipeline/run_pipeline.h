// Runs the stages of a run in their order, from photos to a report.
#pragma once

#include <string>
#include <vector>

#include "pipeline/run/run_context.h"
#include "pipeline/workspace/style_folders.h"

namespace regrade {

// Runs the stages from `first` to `last` (names of kStageNames); each reads the results of
// earlier ones from disk. Stages before `first` must be done; --restart-from an earlier one
// means `first`. False only in a dry run, where a stage would have to be done. Throws what
// stages throw.
bool RunPipeline(const std::string& first, const std::string& last, RunContext* context);

// The stages from `first` to --until, "report" as a rule, of each style in turn, in its own
// folder; each film is copied to the top of the output folder. The scene's stages must be done.
void RunStyles(const std::string& first, const std::vector<NamedStyle>& styles,
               RunContext* context);

}  // namespace regrade
