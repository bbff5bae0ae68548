// From measurements to a price list: medians, spreads, errors against the accurate end, and
// which variants nothing beats.
#pragma once

#include <string>
#include <vector>

#include "pipeline/report/data.h"
#include "pipeline/tradeoff/measurements.h"

namespace regrade {

// A row for each variant that was measured at least once, plane by plane in the variants'
// order. `base` names the base ("preset draft"). See CostRow for what is in a row.
//
// A variant is on the front where no other of its plane is at least as accurate in no more CPU
// time, and better in one of the two. It is dominated where the other one is better by more
// than the spreads of both: with one repetition, or within the noise, nothing is.
std::vector<CostRow> CostTable(const std::vector<Variant>& variants,
                               const std::vector<Measurement>& measurements,
                               const std::string& base);

// The list as text for a terminal, and as CSV with a head.
std::string CostTableText(const std::vector<CostRow>& rows);
std::string CostTableCsv(const std::vector<CostRow>& rows);

}  // namespace regrade
