// From stage records to the report's structs, and the evaluation as a record keeps it.
#pragma once

#include <vector>

#include "evaluate/consistency.h"
#include "evaluate/fidelity.h"
#include "pipeline/report/data.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {

// The figures of stage "evaluate":
// {"consistency": [...], "consistency_pairs": [...], "fidelity": [...]}.
JsonValue EvaluationRecord(const ConsistencyReport& consistency,
                           const std::vector<FidelityRow>& fidelity,
                           const std::vector<HeatMapFile>& heat_maps = {});

// The two tables of such a record, and nothing else.
RunReport ReportOfEvaluation(const JsonValue& metrics);

// Everything that the finished stages of a folder have measured. Options, command and times of
// this start are for the caller to add.
RunReport ReportFromRecords(const Workspace& workspace);

}  // namespace regrade
