// The stages of a run, in their order.
#pragma once

#include "pipeline/run/run_context.h"
#include "pipeline/workspace/stage_runner.h"

namespace regrade {

// Each describes its stage, including its work; nothing is executed yet.
Stage PoseStage(RunContext* context);
Stage ReconstructStage(RunContext* context);
Stage Style2dStage(RunContext* context);
Stage StylizeStage(RunContext* context);
Stage RenderStage(RunContext* context);
Stage EvaluateStage(RunContext* context);
Stage ReportStage(RunContext* context);

}  // namespace regrade
