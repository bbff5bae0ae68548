// Formats the evaluation as tables for terminals and papers.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "evaluate/consistency.h"
#include "evaluate/fidelity.h"
#include "evaluate/table_text.h"

namespace regrade {

// What tables say besides the metrics.
struct TableContext {
  std::string form = "text";                  // one of kTableForms
  std::string protocol;                       // whose values the options have; or empty
  std::string version;                        // of the program; or empty
  std::map<std::string, std::string> labels;  // what a sequence is called, if not by its name
  std::vector<std::string> remarks;           // further ones, below the first table
};

// Both tables, always together, because consistency is meaningful only with fidelity. A
// sequence without fidelity has a row of dashes and a remark. Undefined metrics are printed as
// "-" with the reason below, infinite ones as "inf". The titles, in LaTeX the captions, name
// protocol, flow, number and size of frames, and version. Errors: those of FormatTable.
std::string FormatTables(const ConsistencyReport& consistency,
                         const std::vector<FidelityRow>& fidelity,
                         const TableContext& context = {});

}  // namespace regrade
