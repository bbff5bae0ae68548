// Makes the cost table from measurements: medians, spreads, errors relative to the accurate
// end, and the Pareto front of each benchmark.
#pragma once

#include <string>
#include <vector>

#include "pipeline/report/data.h"
#include "pipeline/study/measurements.h"

namespace regrade {

// A row (see CostRow) for each variant that was measured at least once, grouped by benchmark,
// in the variants' order. `base` names the base ("preset draft").
//
// A variant is on the Pareto front if no other of its benchmark is at least as accurate in no
// more CPU time, and better in one of the two. It is dominated if another one is better by more
// than the spreads of both; never with a single repetition.
std::vector<CostRow> CostTable(const std::vector<Variant>& variants,
                               const std::vector<Measurement>& measurements,
                               const std::string& base);

// The table as text for a terminal, and as CSV with a header.
std::string CostTableText(const std::vector<CostRow>& rows);
std::string CostTableCsv(const std::vector<CostRow>& rows);

}  // namespace regrade
