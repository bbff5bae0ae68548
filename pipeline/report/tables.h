// The tables of report.html, one function a section; each returns "" when there is nothing to
// tell.
#pragma once

#include <string>

#include "pipeline/report/data.h"

namespace regrade {

// The number, or a dash that tells why there is none.
std::string MetricHtml(const Metric& metric, int decimals, const std::string& unit = "");

std::string HeadlineMetricsHtml(const RunReport& report);
// Consistency with fidelity beside it in the same rows: a grey film is consistent, so neither
// figure stands alone.
std::string ConsistencyHtml(const RunReport& report);
std::string EffectsHtml(const RunReport& report);
std::string StagesHtml(const RunReport& report);
// `run_json`: what --config reads; may be empty.
std::string RepeatHtml(const RunReport& report, const std::string& run_json);

}  // namespace regrade
