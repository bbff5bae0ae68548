// The tables of report.html, one function for each section; "" for a section without content.
#pragma once

#include <string>

#include "pipeline/report/data.h"

namespace regrade {

std::string HeadlineMetricsHtml(const RunReport& report);
// Consistency and fidelity in the same rows: a grey film is consistent, so neither is shown
// alone.
std::string ConsistencyHtml(const RunReport& report);
// Of mode stylegaussian.
std::string WarpedHtml(const RunReport& report);
std::string EffectsHtml(const RunReport& report);
std::string StagesHtml(const RunReport& report);
// `run_json`: the text of run.json; may be empty.
std::string RepeatHtml(const RunReport& report, const std::string& run_json);

}  // namespace regrade
