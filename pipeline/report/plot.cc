#include "pipeline/report/plot.h"

#include <algorithm>
#include <cmath>

#include "pipeline/report/html_text.h"

namespace regrade {
namespace {

constexpr double kWidth = 560, kHeight = 246;
constexpr double kLeft = 40, kRight = 12, kTop = 24, kBottom = 34;
constexpr int kColours = 4;
constexpr int kTicks = 5;          // aimed at on a linear axis
constexpr size_t kMostTips = 200;  // points of a line with a number to hover over

// One axis: the range of its values, and their positions in the drawing.
struct Axis {
  double low = INFINITY, high = -INFINITY;
  bool log = false;
  double from = 0, to = 0;  // in the drawing

  bool Accepts(double value) const { return std::isfinite(value) && (!log || value > 0); }
  void Include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  double Fraction(double value) const {
    return log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
  }
  double Position(double value) const { return from + Fraction(value) * (to - from); }
};

// 1, 2 or 5 times a power of ten; about kTicks of them make the span.
double EvenStep(double span) {
  const double raw = span / kTicks, power = std::pow(10, std::floor(std::log10(raw)));
  for (const double step : {1.0, 2.0, 5.0})
    if (raw <= step * power) return step * power;
  return 10 * power;
}

std::vector<double> TicksOf(const Axis& axis) {
  std::vector<double> ticks;
  if (axis.log) {
    // Powers of two, and of ten where the axis spans more.
    const double base = axis.high / axis.low > 64 ? 10 : 2;
    for (double value = std::pow(base, std::ceil(std::log(axis.low) / std::log(base)));
         value <= axis.high; value *= base)
      ticks.push_back(value);
    return ticks;
  }
  const double step = EvenStep(axis.high - axis.low);
  for (double i = std::ceil(axis.low / step - 1e-9); i * step <= axis.high + 1e-9 * step; ++i)
    ticks.push_back(i * step);
  return ticks;
}

// With the fewest decimals that distinguish the ticks.
std::string TickText(double value, const std::vector<double>& ticks) {
  double step = std::abs(value);
  for (size_t i = 1; i < ticks.size(); ++i) step = std::min(step, ticks[i] - ticks[i - 1]);
  int decimals = 0;
  if (step > 0 && step < 1)
    decimals = std::min(6, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
  return FixedNumber(value, decimals);
}

// Adds a margin, and whole steps on linear axes, so that lines do not touch the frame.
void Widen(Axis* axis) {
  if (axis->log) {
    const double room = std::pow(axis->high / axis->low, 0.05) * 1.02;
    axis->low /= room, axis->high *= room;
    return;
  }
  if (axis->high - axis->low < 1e-9 * std::max(1.0, std::abs(axis->high)))
    axis->low -= 1, axis->high += 1;
  const double step = EvenStep(axis->high - axis->low);
  axis->low = std::floor(axis->low / step) * step;
  axis->high = std::ceil(axis->high / step) * step;
}

std::string Line(double x1, double y1, double x2, double y2) {
  return "<line x1=" + FixedNumber(x1, 1) + " y1=" + FixedNumber(y1, 1) +
         " x2=" + FixedNumber(x2, 1) + " y2=" + FixedNumber(y2, 1) + " />";
}

std::string Label(double x, double y, const char* anchor, const std::string& text) {
  return "<text x=" + FixedNumber(x, 1) + " y=" + FixedNumber(y, 1) + " text-anchor=" + anchor +
         ">" + EscapeHtml(text) + "</text>";
}

std::string AxesSvg(const Axis& x, const Axis& y, const Plot& plot) {
  std::string svg;
  const std::vector<double> rows = TicksOf(y), columns = TicksOf(x);
  for (const double value : rows)
    svg += Line(kLeft, y.Position(value), kWidth - kRight, y.Position(value)) +
           Label(kLeft - 6, y.Position(value) + 4, "end", TickText(value, rows));
  for (const double value : columns)
    svg += Label(x.Position(value), kHeight - kBottom + 14, "middle", TickText(value, columns));
  return svg + Label(kWidth - kRight, kHeight - 4, "end", plot.x) +
         Label(0, 11, "start", plot.y);
}

std::string SeriesSvg(const PlotSeries& series, const Axis& x, const Axis& y) {
  const std::string colour = std::to_string(series.colour % kColours);
  std::string svg, positions, tips;
  const auto finish = [&] {
    if (!positions.empty())
      svg +=
          "<polyline class=k" + colour + " points=\"" + positions + "\" style=\"fill:none\"/>";
    positions.clear();
  };
  for (const PlotPoint& point : series.points) {
    if (!point.y || !y.Accepts(*point.y) || !x.Accepts(point.x)) {
      finish();
      continue;
    }
    const std::string px = FixedNumber(x.Position(point.x), 1),
                      py = FixedNumber(y.Position(*point.y), 1);
    const auto circle = [&](const char* classes, const char* radius, const std::string& tip) {
      return std::string("<circle class=") + classes + " cx=" + px + " cy=" + py +
             " r=" + radius + "><title>" + tip + "</title></circle>";
    };
    if (series.dots) {
      svg += circle(("k" + colour).c_str(), "4", EscapeHtml(point.label));
      continue;
    }
    positions += px + "," + py + " ";
    if (!series.name.empty() && series.points.size() <= kMostTips)
      tips += circle("tip", "5",
                     EscapeHtml(series.name) + ", " + FixedNumber(point.x, 0) + ": " +
                         FixedNumber(*point.y, 2));
  }
  finish();
  return svg + tips;
}

}  // namespace

std::string PlotHtml(const Plot& plot) {
  Axis x{.log = plot.log_x, .from = kLeft, .to = kWidth - kRight};
  Axis y{.log = plot.log_y, .from = kHeight - kBottom, .to = kTop};
  int drawn = 0;
  for (const PlotSeries& series : plot.series)
    for (const PlotPoint& point : series.points) {
      if (!point.y || !x.Accepts(point.x) || !y.Accepts(*point.y)) continue;
      x.Include(point.x);
      y.Include(*point.y);
      ++drawn;
    }
  if (drawn < 2) return "";
  Widen(&y);
  const bool dots = plot.series[0].dots;
  if (dots || x.high <= x.low) Widen(&x);

  std::string svg = "<svg class=chart role=img aria-label=\"" + EscapeHtml(plot.title) +
                    "\" viewBox=\"0 0 " + FixedNumber(kWidth, 0) + " " +
                    FixedNumber(kHeight, 0) + "\">" + AxesSvg(x, y, plot);
  std::string legend;
  for (const PlotSeries& series : plot.series) {
    svg += SeriesSvg(series, x, y);
    if (!series.name.empty())
      legend += "<span><i class=k" + std::to_string(series.colour % kColours) + "></i>" +
                EscapeHtml(series.name) + "</span>";
  }
  return "<figure class=plot>" + svg + "</svg><div class=legend>" + legend + "</div>" +
         (plot.note.empty() ? "" : "<p class=note>" + plot.note + "</p>") + "</figure>";
}

}  // namespace regrade
