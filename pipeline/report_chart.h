// The small drawings of report.html: how consistent each pair of frames is, sequence by
// sequence, and how the network's Lipschitz bound went while it was learned.
#pragma once

#include <string>

#include "pipeline/report_data.h"

namespace regrade {

// Inline SVG of tc_psnr_pairs_db at the smallest gap; gaps in a line are undefined pairs. ""
// without pairs.
std::string ConsistencyChartHtml(const RunReport& report);

// Inline SVG of bound_at_steps, with K_est beside it, on a logarithmic scale. "" without two
// points.
std::string BoundChartHtml(const StylizeReport& stage);

}  // namespace regrade
