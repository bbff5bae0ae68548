// One small drawing for report.html: how consistent each pair of frames is, sequence by
// sequence.
#pragma once

#include <string>

#include "pipeline/report_data.h"

namespace regrade {

// Inline SVG of tc_psnr_pairs_db at the smallest gap; gaps in a line are undefined pairs. ""
// without pairs.
std::string ConsistencyChartHtml(const RunReport& report);

}  // namespace regrade
