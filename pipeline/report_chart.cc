// Draws TC-PSNR over time as one polyline for each sequence, and a bound over steps.
#include "pipeline/report_chart.h"

#include <algorithm>
#include <climits>
#include <cmath>

#include "pipeline/html_text.h"

namespace regrade {
namespace {

constexpr double kWidth = 560, kHeight = 180;
constexpr double kLeft = 26, kRight = 8, kTop = 8, kBottom = 8;
constexpr int kColours = 4;  // of the style sheet: .k0 to .k3

struct Range {
  double low, high;
};

// Whole 5 dB steps around all values; {0, 0} when there are none.
Range ValueRange(const std::vector<const ConsistencyFigures*>& rows) {
  double low = INFINITY, high = -INFINITY;
  for (const ConsistencyFigures* row : rows) {
    for (const Figure& figure : row->tc_psnr_pairs_db) {
      if (!figure.value) continue;
      low = std::min(low, *figure.value);
      high = std::max(high, *figure.value);
    }
  }
  if (!(low <= high)) return {0, 0};
  low = std::floor(low / 5) * 5;
  return {low, std::max(std::ceil(high / 5) * 5, low + 5)};
}

std::string Polylines(const ConsistencyFigures& row, int colour, Range range) {
  const size_t n = row.tc_psnr_pairs_db.size();
  const double dx = (kWidth - kLeft - kRight) / std::max<double>(1, n - 1.0);
  std::string html, points;
  const auto finish = [&] {
    if (!points.empty()) {
      html += "<polyline class=k" + std::to_string(colour) + " points=\"" + points +
              "\" style=\"fill:none\"/>";
    }
    points.clear();
  };
  for (size_t i = 0; i < n; ++i) {
    const auto& value = row.tc_psnr_pairs_db[i].value;
    if (!value) {
      finish();
      continue;
    }
    const double share = (*value - range.low) / (range.high - range.low);
    points += FixedNumber(kLeft + static_cast<double>(i) * dx, 1) + "," +
              FixedNumber(kHeight - kBottom - share * (kHeight - kTop - kBottom), 1) + " ";
  }
  finish();
  return html;
}

}  // namespace

std::string ConsistencyChartHtml(const RunReport& report) {
  int gap = INT_MAX;
  for (const auto& row : report.consistency) {
    if (!row.tc_psnr_pairs_db.empty()) gap = std::min(gap, row.gap);
  }
  std::vector<const ConsistencyFigures*> rows;
  for (const auto& row : report.consistency) {
    if (row.gap == gap && !row.tc_psnr_pairs_db.empty()) rows.push_back(&row);
  }
  const Range range = ValueRange(rows);
  if (range.low == range.high) return "";

  std::string html =
      "<svg class=chart role=img aria-label=\"TC-PSNR of each pair of frames\" viewBox=\"0 0 " +
      FixedNumber(kWidth, 0) + " " + FixedNumber(kHeight, 0) + "\">";
  const double step = range.high - range.low > 20 ? 10 : 5;
  for (double db = range.low; db <= range.high; db += step) {
    const double y = kHeight - kBottom -
                     (db - range.low) / (range.high - range.low) * (kHeight - kTop - kBottom);
    html += "<line x1=" + FixedNumber(kLeft, 0) + " x2=" + FixedNumber(kWidth - kRight, 0) +
            " y1=" + FixedNumber(y, 1) + " y2=" + FixedNumber(y, 1) +
            " /><text x=" + FixedNumber(kLeft - 6, 0) + " y=" + FixedNumber(y + 4, 1) +
            " text-anchor=end>" + FixedNumber(db, 0) + "</text>";
  }
  std::string legend = "<div class=legend>";
  for (size_t k = 0; k < rows.size(); ++k) {
    const int colour = static_cast<int>(k) % kColours;
    html += Polylines(*rows[k], colour, range);
    legend += "<span><i class=k" + std::to_string(colour) + "></i>" +
              EscapeHtml(rows[k]->sequence) + "</span>";
  }
  return html + "</svg>" + legend +
         "</div><p class=note>TC-PSNR in dB of each pair of frames " + std::to_string(gap) +
         " apart, in order of time.</p>";
}

std::string BoundChartHtml(const StylizeReport& stage) {
  std::vector<std::pair<int64_t, double>> points;
  for (const auto& point : stage.bound_at_steps)
    if (point.second > 0) points.push_back(point);
  if (points.size() < 2 || points.back().first <= points.front().first) return "";
  double low = points[0].second, high = low;
  const auto see = [&](double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  };
  for (const auto& point : points) see(point.second);
  const bool has_k_est = stage.k_est.value && *stage.k_est.value > 0;
  if (has_k_est) see(*stage.k_est.value);
  low /= 1.1, high *= 1.1;
  const auto y_of = [&](double value) {
    return kHeight - kBottom -
           std::log(value / low) / std::log(high / low) * (kHeight - kTop - kBottom);
  };
  const double first = static_cast<double>(points.front().first),
               span = static_cast<double>(points.back().first) - first;
  std::string html =
      "<svg class=chart role=img aria-label=\"Lipschitz bound over steps\" viewBox=\"0 0 " +
      FixedNumber(kWidth, 0) + " " + FixedNumber(kHeight, 0) + "\">";
  // Powers of two, and of ten where the curve spans more.
  const double base = high / low > 64 ? 10 : 2;
  for (double value = std::pow(base, std::ceil(std::log(low) / std::log(base))); value < high;
       value *= base) {
    const std::string y = FixedNumber(y_of(value), 1);
    html += "<line x1=" + FixedNumber(kLeft, 0) + " x2=" + FixedNumber(kWidth - kRight, 0) +
            " y1=" + y + " y2=" + y + " /><text x=" + FixedNumber(kLeft - 6, 0) +
            " y=" + FixedNumber(y_of(value) + 4, 1) + " text-anchor=end>" +
            FixedNumber(value, value < 1 ? 2 : 0) + "</text>";
  }
  const auto line = [&](int colour, const std::string& places) {
    html += "<polyline class=k" + std::to_string(colour) + " points=\"" + places +
            "\" style=\"fill:none\"/>";
  };
  std::string places;
  for (const auto& [step, bound] : points)
    places +=
        FixedNumber(
            kLeft + (static_cast<double>(step) - first) / span * (kWidth - kLeft - kRight), 1) +
        "," + FixedNumber(y_of(bound), 1) + " ";
  line(0, places);
  std::string legend = "<div class=legend><span><i class=k0></i>Lipschitz bound</span>";
  if (has_k_est) {
    const std::string y = FixedNumber(y_of(*stage.k_est.value), 1);
    line(1, FixedNumber(kLeft, 1) + "," + y + " " + FixedNumber(kWidth - kRight, 1) + "," + y);
    legend += "<span><i class=k1></i>K_est, the colours' own</span>";
  }
  return html + "</svg>" + legend + "</div><p class=note>From step " +
         std::to_string(points.front().first) + " to " + std::to_string(points.back().first) +
         " of the style's network, from exact singular values.</p>";
}

}  // namespace regrade
