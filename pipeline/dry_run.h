// What a command would do and how long it would take, without doing it; and what its stages
// are expected to take while it does.
#pragma once

#include <string>
#include <vector>

#include "pipeline/run/run_context.h"
#include "pipeline/run/stage_estimate.h"
#include "pipeline/workspace/style_folders.h"

namespace regrade {

// From the poses in the output folder, or else from the files of the source, of which one photo
// is read; with the pace of stages that are done. Throws what reading them throws.
std::vector<StageEstimate> ExpectedStages(RunContext* context);

// Says that the stages from `first` to `last` would follow, of `style` or, where that is empty,
// of the scene, and notes them in context->planned.
void PlanStages(const std::string& first, const std::string& last, const std::string& style,
                RunContext* context);

// The same of the stages from `first` to --until of each style.
void PlanStyles(const std::string& first, const std::vector<NamedStyle>& styles,
                RunContext* context);

// The plan of a new folder, up to stage `last` of the scene: what is taken, and what memory and
// --preset paper mean for it.
void PlanNewScene(const std::string& last, RunContext* context);

// Of all that was planned: "about 3 min 20 s in all"; with --json an event "plan", too.
void SayPlan(const RunContext& context);

// Whether a stage that was planned would be done.
bool WouldWork(const RunContext& context);

}  // namespace regrade
