// The drawings of report.html: how consistent each pair of frames is, sequence by sequence, how
// the fit learned, and how the network's Lipschitz bound went.
#pragma once

#include <string>

#include "pipeline/report/data.h"

namespace regrade {

// tc_psnr_pairs_db at the smallest gap; gaps in a line are undefined pairs. Frames at the
// photos' places and those of the film's way have a drawing each. "" without pairs.
std::string ConsistencyChartHtml(const RunReport& report);

// psnr_at_steps, with the held-out figure beside it. "" without two points.
std::string FitChartHtml(const ReconstructReport& stage);

// bound_at_steps, with K_est beside it, on a logarithmic scale. "" without two points.
std::string BoundChartHtml(const StylizeReport& stage);

}  // namespace regrade
