#include "pipeline/report/chart.h"

#include <algorithm>
#include <climits>

#include "pipeline/report/html_text.h"
#include "pipeline/report/plot.h"
#include "pipeline/report/sequence_names.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

bool IsOfFilm(const ConsistencyMetrics& row) {
  return row.sequence.starts_with(kPathPrefix) && row.sequence != kPathPrefix;
}

// A sequence has the same colour in every chart.
int ColourOf(std::string sequence, size_t index) {
  if (sequence.starts_with(kPathPrefix)) sequence.erase(0, std::string(kPathPrefix).size());
  const char* known[] = {"source", "views_2d", "styled", "photos"};
  for (int k = 0; k < 4; ++k)
    if (sequence == known[k]) return k;
  return static_cast<int>(index % 4);
}

// A constant that a curve is compared with, from its first step to its last.
PlotSeries Level(const std::string& name, double value, int64_t first, int64_t last,
                 int colour) {
  return {name, {{double(first), value, ""}, {double(last), value, ""}}, colour};
}

std::string ConsistencyChart(const EvaluationMetrics& metrics, bool film) {
  int gap = INT_MAX;
  const auto is_shown = [film](const ConsistencyMetrics& row) {
    return IsOfFilm(row) == film && !row.tc_psnr_pairs_db.empty();
  };
  for (const auto& row : metrics.consistency)
    if (is_shown(row)) gap = std::min(gap, row.gap);
  Plot plot;
  for (const auto& row : metrics.consistency) {
    if (!is_shown(row) || row.gap != gap) continue;
    PlotSeries series;
    series.name = SequenceLabel(row.sequence);
    series.colour = ColourOf(row.sequence, plot.series.size());
    for (size_t i = 0; i < row.tc_psnr_pairs_db.size(); ++i)
      series.points.push_back({static_cast<double>(i), row.tc_psnr_pairs_db[i].value, ""});
    plot.series.push_back(std::move(series));
  }
  if (plot.series.empty()) return "";
  plot.title =
      film ? "TC-PSNR of each pair of the film's frames" : "TC-PSNR of each pair of frames";
  plot.x = "first frame of the pair";
  plot.y = "dB";
  const std::string pairs =
      gap == 1 ? "consecutive frames" : "frames " + std::to_string(gap) + " apart";
  plot.note = "TC-PSNR of " + pairs + (film ? " of the film" : " at the photos' positions") +
              ", in dB; higher is more consistent.";
  return PlotHtml(plot);
}

}  // namespace

std::string ConsistencyChartHtml(const EvaluationMetrics& metrics) {
  return ConsistencyChart(metrics, false) + ConsistencyChart(metrics, true);
}

std::string FitChartHtml(const ReconstructReport& stage) {
  const auto& curve = stage.psnr_at_steps;
  if (curve.size() < 2) return "";
  Plot plot;
  plot.title = "PSNR of the fit over steps";
  plot.x = "steps";
  plot.y = "dB";
  PlotSeries series{"training rays", {}, 1};
  for (const auto& [step, psnr] : curve)
    series.points.push_back({static_cast<double>(step), psnr, ""});
  plot.series.push_back(std::move(series));
  if (stage.psnr_heldout_db.value)
    plot.series.push_back(Level("held-out photos, at the end", *stage.psnr_heldout_db.value,
                                curve.front().first, curve.back().first, 2));
  plot.note = "PSNR of the reconstruction over " + std::to_string(curve.back().first) +
              " steps, in dB.";
  return PlotHtml(plot);
}

std::string BoundChartHtml(const StylizeReport& stage) {
  const auto& curve = stage.bound_at_steps;
  if (curve.size() < 2 || curve.back().first <= curve.front().first) return "";
  Plot plot;
  plot.title = "Lipschitz bound over steps";
  plot.x = "steps";
  plot.y = "Lipschitz bound";
  plot.log_y = true;
  PlotSeries series{"Lipschitz bound", {}, 2};
  for (const auto& [step, bound] : curve)
    series.points.push_back({static_cast<double>(step), bound, ""});
  plot.series.push_back(std::move(series));
  if (stage.k_est.value && *stage.k_est.value > 0)
    plot.series.push_back(Level("K_est, estimated from the colours", *stage.k_est.value,
                                curve.front().first, curve.back().first, 1));
  plot.note = "Lipschitz bound of the style network from step " +
              std::to_string(curve.front().first) + " to " +
              std::to_string(curve.back().first) + ", from exact singular values.";
  return PlotHtml(plot);
}

}  // namespace regrade
