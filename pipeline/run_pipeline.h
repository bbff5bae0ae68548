// Runs the stages of a run in their order, from photos to a report.
#pragma once

#include <string>
#include <vector>

#include "pipeline/run/run_context.h"
#include "pipeline/workspace/style_folders.h"

namespace regrade {

// Runs the stages from `first` to `last` (names of kStageNames); each reads the results of
// earlier ones from disk. Stages before `first` must be done; --restart-from an earlier one
// means `first`. False only in a dry run, where a stage would have to be done; what it would do
// is added to context->planned. `styles_after`: how many whole styles follow in this command,
// for the time that is left. Throws what stages throw.
bool RunPipeline(const std::string& first, const std::string& last, RunContext* context,
                 int styles_after = 0);

// The stages from `first` to --until, "report" as a rule, of each style in turn, in its own
// folder of --out; each film is copied to the top of it. The scene's stages must be done. A dry
// run says what each would take, and all of them.
void RunStyles(const std::string& first, const std::vector<NamedStyle>& styles,
               RunContext* context);

// The part context->parts.part of the frames and films of a style, whose folder other parts may
// share: see RenderPart. The stages before must be done.
void RunPart(const std::string& style, RunContext* context);

}  // namespace regrade
