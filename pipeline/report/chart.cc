// Chooses what each drawing of the report shows.
#include "pipeline/report/chart.h"

#include <algorithm>
#include <climits>

#include "pipeline/report/html_text.h"
#include "pipeline/report/plot.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

bool OfFilm(const ConsistencyMetrics& row) {
  return row.sequence.starts_with(kPathPrefix) && row.sequence != kPathPrefix;
}

// The sequence's colour is the same in every drawing.
int ColourOf(std::string sequence, size_t place) {
  if (sequence.starts_with(kPathPrefix)) sequence.erase(0, std::string(kPathPrefix).size());
  const char* known[] = {"source", "views_2d", "styled", "photos"};
  for (int k = 0; k < 4; ++k)
    if (sequence == known[k]) return k;
  return static_cast<int>(place % 4);
}

// Levels that a curve is compared with are drawn from its first step to its last.
PlotSeries Level(const std::string& name, double value, int64_t first, int64_t last,
                 int colour) {
  return {name, {{double(first), value, ""}, {double(last), value, ""}}, colour};
}

std::string ConsistencyChart(const RunReport& report, bool film) {
  int gap = INT_MAX;
  const auto wanted = [film](const ConsistencyMetrics& row) {
    return OfFilm(row) == film && !row.tc_psnr_pairs_db.empty();
  };
  for (const auto& row : report.consistency)
    if (wanted(row)) gap = std::min(gap, row.gap);
  Plot plot;
  for (const auto& row : report.consistency) {
    if (!wanted(row) || row.gap != gap) continue;
    PlotSeries series;
    series.name = row.sequence;
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
  plot.note = "TC-PSNR in dB of each pair of frames " + std::to_string(gap) + " apart, " +
              (film ? "along the film's way." : "in order of time.");
  return PlotHtml(plot);
}

}  // namespace

std::string ConsistencyChartHtml(const RunReport& report) {
  return ConsistencyChart(report, false) + ConsistencyChart(report, true);
}

std::string FitChartHtml(const ReconstructReport& stage) {
  const auto& curve = stage.psnr_at_steps;
  if (curve.size() < 2) return "";
  Plot plot;
  plot.title = "PSNR of the fit over steps";
  plot.x = "steps";
  plot.y = "dB";
  PlotSeries series{"PSNR on the rays of the last steps", {}, 1};
  for (const auto& [step, psnr] : curve)
    series.points.push_back({static_cast<double>(step), psnr, ""});
  plot.series.push_back(std::move(series));
  if (stage.psnr_heldout_db.value)
    plot.series.push_back(Level("held-out photos, at the end", *stage.psnr_heldout_db.value,
                                curve.front().first, curve.back().first, 2));
  plot.note = "The fit, to step " + std::to_string(curve.back().first) +
              "; a bend is where the grid becomes finer.";
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
    plot.series.push_back(Level("K_est, the colours' own", *stage.k_est.value,
                                curve.front().first, curve.back().first, 1));
  plot.note = "From step " + std::to_string(curve.front().first) + " to " +
              std::to_string(curve.back().first) +
              " of the style's network, from exact singular values.";
  return PlotHtml(plot);
}

}  // namespace regrade
