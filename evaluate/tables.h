// Formats the evaluation as plain text.
#pragma once

#include <string>
#include <vector>

#include "evaluate/consistency.h"
#include "evaluate/fidelity.h"

namespace regrade {

// "text" aligns columns for a terminal; the others are for pasting.
inline constexpr char kTableForms[] = "text|markdown|csv|latex";

// Both tables, always together, because consistency is meaningful only with fidelity. A
// sequence without fidelity has a row of dashes and a remark. Undefined metrics are printed as
// "-" with the reason below, infinite ones as "inf".
// In the forms csv and latex, titles and remarks are comments (# and %). Errors: kUsage for a
// form that is not one of kTableForms.
std::string FormatTables(const ConsistencyReport& consistency,
                         const std::vector<FidelityRow>& fidelity,
                         const std::string& form = "text");

}  // namespace regrade
