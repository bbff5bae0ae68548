#include "pipeline/report/costs.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "pipeline/report/cost_rows.h"
#include "pipeline/report/html_table.h"
#include "pipeline/report/html_text.h"
#include "pipeline/report/plot.h"

namespace regrade {
namespace {

using Rows = std::vector<const CostRow*>;

// Accuracy over CPU time; a line joins the Pareto front.
std::string ParetoFrontHtml(const Rows& rows) {
  Plot plot;
  plot.title = "accuracy over time, " + rows[0]->benchmark;
  plot.x = "CPU seconds";
  plot.y = rows[0]->unit;
  plot.log_x = true;
  PlotSeries dominated{"dominated", {}, 0, true}, front{"Pareto front", {}, 2, true},
      baseline{"baseline", {}, 1, true}, line{"", {}, 2};
  for (const CostRow* row : rows) {
    if (!row->cpu_seconds.value || !row->accuracy.value) continue;
    const PlotPoint point{*row->cpu_seconds.value, *row->accuracy.value, NameOf(*row)};
    (row->parameter.empty() ? baseline
     : row->on_pareto_front ? front
                            : dominated)
        .points.push_back(point);
    if (row->on_pareto_front) line.points.push_back(point);
  }
  if (line.points.size() < 2) line.points.clear();
  std::sort(line.points.begin(), line.points.end(),
            [](const PlotPoint& a, const PlotPoint& b) { return a.x < b.x; });
  for (PlotSeries* series : {&dominated, &front, &baseline, &line})
    if (!series->points.empty()) plot.series.push_back(std::move(*series));
  return PlotHtml(plot);
}

std::string SecondsHtml(const Metric& seconds, const Metric& spread) {
  if (!seconds.value) return MetricHtml(seconds, 2);
  const int decimals = *seconds.value < 1 ? 4 : *seconds.value < 100 ? 2 : 0;
  return MetricHtml(seconds, decimals) +
         (spread.value ? " <span class=soft>±" + MetricHtml(spread, decimals) + "</span>" : "");
}

// What stands beside a PSNR to photos.
constexpr std::pair<const char*, std::optional<double> CostRow::*> kBeside[] = {
    {"SSIM", &CostRow::ssim},
    {"detail kept", &CostRow::detail_kept},
    {"LPIPS", &CostRow::lpips}};

bool Measured(const Rows& rows, std::optional<double> CostRow::*member) {
  return std::any_of(rows.begin(), rows.end(),
                     [member](const CostRow* row) { return (row->*member).has_value(); });
}

std::string RowHtml(const CostRow& row, const Rows& rows) {
  std::string beside;
  for (const auto& [name, member] : kBeside)
    if (Measured(rows, member)) beside += Number(Metric(row.*member), 3);
  const std::string comparison = row.on_pareto_front ? "<span class=on>Pareto front</span>"
                                 : row.dominated_by.empty()
                                     ? ""
                                     : "dominated by " + EscapeHtml(row.dominated_by);
  return "<tr><td>" +
         (row.parameter.empty() ? "baseline"
                                : "<code>" + EscapeHtml(row.parameter) + "</code>") +
         "<td class=file>" + EscapeHtml(row.setting) + "<td class=n>" +
         SecondsHtml(row.seconds, row.seconds_spread) + "<td class=n>" +
         SecondsHtml(row.cpu_seconds, row.cpu_spread) + "<td class=n>" +
         MetricHtml(row.accuracy, 3) + "<td class=n>" + MetricHtml(row.error, 3) + beside +
         "<td class=w>" + comparison + "</tr>";
}

std::string BenchmarkHtml(const Rows& rows) {
  std::string body, beside;
  for (const auto& [name, member] : kBeside)
    if (Measured(rows, member)) beside += std::string("<th class=n>") + name;
  for (const CostRow* row : rows) body += RowHtml(*row, rows);
  return "<h3>" + EscapeHtml(rows[0]->benchmark) +
         "</h3><p>Accuracy: " + EscapeHtml(rows[0]->measure) + ", " +
         EscapeHtml(rows[0]->unit) + ".</p>" + ParetoFrontHtml(rows) +
         "<div class=scroll><table><thead><tr><th>parameter<th>value<th class=n>time, s<th "
         "class=n>CPU time, s<th class=n>accuracy<th class=n>error" +
         beside + "<th></tr></thead><tbody>" + body + "</tbody></table></div>";
}

}  // namespace

std::string CostsHtml(const RunReport& report) {
  if (report.costs.empty()) return "";
  std::vector<Rows> benchmarks;
  for (const CostRow& row : report.costs) {
    auto benchmark =
        std::find_if(benchmarks.begin(), benchmarks.end(),
                     [&row](const Rows& rows) { return rows[0]->benchmark == row.benchmark; });
    if (benchmark == benchmarks.end()) benchmark = benchmarks.insert(benchmarks.end(), Rows());
    benchmark->push_back(&row);
  }
  std::string html;
  for (const Rows& rows : benchmarks) html += BenchmarkHtml(rows);
  return "<h2>Accuracy and cost</h2><p>Measured on this machine with this capture. Each row "
         "changes one parameter of the baseline. Medians, ± half the range. The error is the "
         "loss against the parameter's most accurate value. No row of the Pareto front is "
         "beaten in accuracy at its CPU time.</p>" +
         html;
}

}  // namespace regrade
