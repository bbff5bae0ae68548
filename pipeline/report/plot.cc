#include "pipeline/report/plot.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "pipeline/files/json_file.h"
#include "pipeline/report/html_text.h"

namespace regrade {
namespace {

constexpr double kWidth = 560, kHeight = 230;
constexpr double kLeft = 40, kRight = 12, kTop = 8, kBottom = 34;
constexpr int kColours = 4;
constexpr int kTicks = 5;  // wanted on an axis of even steps

// One axis: what it spans, and where values lie on the drawing.
struct Axis {
  double low = INFINITY, high = -INFINITY;
  bool log = false;
  double from = 0, to = 0;  // on the drawing

  bool Takes(double value) const { return std::isfinite(value) && (!log || value > 0); }
  void See(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  double Share(double value) const {
    return log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
  }
  double Place(double value) const { return from + Share(value) * (to - from); }
};

// 1, 2 or 5 times a power of ten, so that about kTicks of them make the span.
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

// As few decimals as tell the ticks apart.
std::string TickText(double value, const std::vector<double>& ticks) {
  double step = std::abs(value);
  for (size_t i = 1; i < ticks.size(); ++i) step = std::min(step, ticks[i] - ticks[i - 1]);
  int decimals = 0;
  if (step > 0 && step < 1)
    decimals = std::min(6, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
  return FixedNumber(value, decimals);
}

// A little room, and whole steps on even axes, so that lines do not lie on the frame.
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

std::string Word(double x, double y, const char* anchor, const std::string& text) {
  return "<text x=" + FixedNumber(x, 1) + " y=" + FixedNumber(y, 1) + " text-anchor=" + anchor +
         ">" + EscapeHtml(text) + "</text>";
}

std::string AxesSvg(const Axis& x, const Axis& y, const Plot& plot) {
  std::string svg;
  const std::vector<double> rows = TicksOf(y), columns = TicksOf(x);
  for (const double value : rows)
    svg += Line(kLeft, y.Place(value), kWidth - kRight, y.Place(value)) +
           Word(kLeft - 6, y.Place(value) + 4, "end", TickText(value, rows));
  for (const double value : columns)
    svg += Word(x.Place(value), kHeight - kBottom + 14, "middle", TickText(value, columns));
  return svg + Word(kWidth - kRight, kHeight - 4, "end", plot.x);
}

std::string SeriesSvg(const PlotSeries& series, const Axis& x, const Axis& y) {
  const std::string colour = std::to_string(series.colour % kColours);
  std::string svg, places;
  const auto finish = [&] {
    if (!places.empty())
      svg += "<polyline class=k" + colour + " points=\"" + places + "\" style=\"fill:none\"/>";
    places.clear();
  };
  for (const PlotPoint& point : series.points) {
    if (!point.y || !y.Takes(*point.y) || !x.Takes(point.x)) {
      finish();
      continue;
    }
    const std::string px = FixedNumber(x.Place(point.x), 1),
                      py = FixedNumber(y.Place(*point.y), 1);
    if (series.dots)
      svg += "<circle class=k" + colour + " cx=" + px + " cy=" + py + " r=4><title>" +
             EscapeHtml(point.label) + "</title></circle>";
    else
      places += px + "," + py + " ";
  }
  finish();
  return svg;
}

// JSON for a <script>: nothing that could end it, or mean anything to HTML.
std::string ScriptJson(const JsonValue& value) {
  std::string text;
  for (const char c : DumpJson(value, -1)) {
    if (c == '<' || c == '>' || c == '&' || c == '\'') {
      char spelled[8];
      std::snprintf(spelled, sizeof spelled, "\\u%04x", static_cast<unsigned>(c));
      text += spelled;
    } else {
      text += c;
    }
  }
  return text;
}

JsonValue DataOf(const Plot& plot) {
  JsonValue data = JsonValue::Object{{"x", plot.x},
                                     {"y", plot.y},
                                     {"log_x", plot.log_x},
                                     {"log_y", plot.log_y},
                                     {"series", JsonValue::Array{}}};
  for (const PlotSeries& series : plot.series) {
    JsonValue::Array points, labels;
    for (const PlotPoint& point : series.points) {
      const bool drawn = point.y && std::isfinite(*point.y) && std::isfinite(point.x);
      points.push_back(
          JsonValue::Array{std::isfinite(point.x) ? JsonValue(point.x) : JsonValue(),
                           drawn ? JsonValue(*point.y) : JsonValue()});
      labels.push_back(point.label);
    }
    const bool labelled =
        std::any_of(series.points.begin(), series.points.end(),
                    [](const PlotPoint& point) { return !point.label.empty(); });
    JsonValue entry = JsonValue::Object{{"name", series.name},
                                        {"colour", series.colour % kColours},
                                        {"dots", series.dots},
                                        {"points", std::move(points)}};
    if (labelled) entry["labels"] = std::move(labels);
    data["series"].Append(std::move(entry));
  }
  return data;
}

}  // namespace

std::string PlotHtml(const Plot& plot) {
  Axis x{.log = plot.log_x, .from = kLeft, .to = kWidth - kRight};
  Axis y{.log = plot.log_y, .from = kHeight - kBottom, .to = kTop};
  int drawn = 0;
  for (const PlotSeries& series : plot.series)
    for (const PlotPoint& point : series.points) {
      if (!point.y || !x.Takes(point.x) || !y.Takes(*point.y)) continue;
      x.See(point.x);
      y.See(*point.y);
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
    legend += "<span><i class=k" + std::to_string(series.colour % kColours) + "></i>" +
              EscapeHtml(series.name) + "</span>";
  }
  return "<figure class=plot>" + svg + "</svg><div class=legend>" + legend +
         "</div><script type=\"application/json\">" + ScriptJson(DataOf(plot)) + "</script>" +
         (plot.note.empty() ? "" : "<p class=note>" + plot.note + "</p>") + "</figure>";
}

}  // namespace regrade
