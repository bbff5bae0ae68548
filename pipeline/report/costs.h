// The price list's part of a page: what each parameter's values cost and buy, as a drawing and
// a table for each plane of accuracy over time.
#pragma once

#include <string>

#include "pipeline/report/data.h"

namespace regrade {

// "" without prices. Settings may be hostile.
std::string CostsHtml(const RunReport& report);

}  // namespace regrade
