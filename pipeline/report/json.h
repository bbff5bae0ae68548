// report.json, schema 1: every number of the report page, for other programs.
#pragma once

#include "pipeline/files/json_file.h"
#include "pipeline/report/data.h"

namespace regrade {

// The whole report. A figure without value is written as "x": null, "x_why": "...". Stages that
// did not run are absent; the prices and the pairs' own figures are present only where they
// were measured.
JsonValue ReportJson(const RunReport& report);

JsonValue CostJson(const CostRow& cost);

// {"schema": 1, "consistency": [...], "fidelity": [...], "consistency_pairs": [...]}: what
// `regrade evaluate` writes for any program's frames; the pairs where there are any.
JsonValue EvaluationJson(const RunReport& report);

}  // namespace regrade
