// Formats the evaluation as plain text.
#pragma once

#include <string>
#include <vector>

#include "evaluate/consistency.h"
#include "evaluate/fidelity.h"
#include "evaluate/table_text.h"

namespace regrade {

// Both tables, always together, because consistency is meaningful only with fidelity. A
// sequence without fidelity has a row of dashes and a remark. Undefined metrics are printed as
// "-" with the reason below, infinite ones as "inf". Errors: those of FormatTable.
std::string FormatTables(const ConsistencyReport& consistency,
                         const std::vector<FidelityRow>& fidelity,
                         const std::string& form = "text");

}  // namespace regrade
