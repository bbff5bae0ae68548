// Reads the metrics of stage records into the report's structs.
#pragma once

#include <vector>

#include "evaluate/consistency_report.h"
#include "evaluate/fidelity_row.h"
#include "pipeline/report/data.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {

EvaluationMetrics MetricsOf(const ConsistencyReport& consistency,
                            const std::vector<FidelityRow>& fidelity,
                            const std::vector<HeatMapFile>& heat_maps = {});

// Everything that the finished stages of a scene and of a style have measured, each recorded in
// its folder (see StageRunner). The caller adds options,
// command and times of this start.
//
// Throws Error(kInput), which names the record and the key, where a metric is missing.
RunReport ReportFromRecords(const Workspace& scene, const Workspace& style);

}  // namespace regrade
