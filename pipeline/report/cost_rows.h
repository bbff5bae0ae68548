// Reads the cost table of a tradeoff.json.
#pragma once

#include <string>
#include <vector>

#include "pipeline/report/data.h"

namespace regrade {

// The rows of a tradeoff.json; none where there is no such file. Throws Error(kInput).
std::vector<CostRow> ReadCostTable(const std::string& path);

}  // namespace regrade
