// The cost table's section of a page: a chart of accuracy over time and a table for each
// benchmark.
#pragma once

#include <string>

#include "pipeline/report/data.h"

namespace regrade {

// "" without costs. Settings may be hostile.
std::string CostsHtml(const RunReport& report);

}  // namespace regrade
