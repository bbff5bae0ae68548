// What is known of a run besides the records of its stages.
#pragma once

#include "pipeline/report/data.h"
#include "pipeline/run/run_context.h"

namespace regrade {

// The report of the scene and of the chosen style: records, options, photos and their spacing;
// without versions, costs and the command. Throws Error(kInput).
RunReport ReportOfRun(const RunContext& context);

}  // namespace regrade
