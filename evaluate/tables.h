// The evaluation as plain text for a terminal or a paper's appendix.
#pragma once

#include <string>
#include <vector>

#include "evaluate/consistency.h"
#include "evaluate/fidelity.h"

namespace regrade {

// Both tables, always together: a consistency figure means nothing without fidelity beside it,
// so there is no function for one alone. A sequence that was not measured for fidelity has a
// row of dashes and a line that says so. Figures that are not defined are printed as "-" with
// the reason below, infinite ones as "inf".
std::string FormatTables(const ConsistencyReport& consistency,
                         const std::vector<FidelityRow>& fidelity);

}  // namespace regrade
