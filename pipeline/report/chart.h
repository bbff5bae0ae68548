// The charts of report.html: consistency of each pair of frames, PSNR while the field is
// fitted, and the network's Lipschitz bound while it is trained.
#pragma once

#include <string>

#include "pipeline/report/data.h"

namespace regrade {

// tc_psnr_pairs_db at the smallest gap; a line breaks at undefined pairs. The frames at the
// photos' positions and those of the film have a chart each. "" without pairs.
std::string ConsistencyChartHtml(const EvaluationMetrics& metrics);

// psnr_at_steps, with the held-out PSNR as a level. "" without two points.
std::string FitChartHtml(const ReconstructReport& stage);

// bound_at_steps, with K_est as a level, on a logarithmic scale. "" without two points.
std::string BoundChartHtml(const StylizeReport& stage);

}  // namespace regrade
