// report.json, schema 2: every number of the report page, for other programs.
#pragma once

#include "pipeline/files/json_file.h"
#include "pipeline/report/data.h"

namespace regrade {

// The whole report. A metric without value is written as "x": null, "x_why": "...". Stages that
// did not run are absent, as are versions and costs where there are none.
JsonValue ReportJson(const RunReport& report);

// {"schema": 2, "regrade": ..., "command": [...], "stages": {"evaluate": {...}}, "consistency":
// [...], "fidelity": [...], "consistency_pairs": [...]}: what `regrade evaluate` writes for
// frames of other programs.
JsonValue EvaluationJson(const RunReport& report);

}  // namespace regrade
