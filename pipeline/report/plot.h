// A drawing of numbers over numbers: static SVG that needs no script, with the same numbers
// beside it for a library that can do more with them.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace regrade {

struct PlotPoint {
  double x = 0;
  std::optional<double> y;  // without one, a line breaks here
  std::string label;        // of this point alone; may be empty
};

struct PlotSeries {
  std::string name;
  std::vector<PlotPoint> points;
  int colour = 0;     // of the style sheet: .k0 to .k3
  bool dots = false;  // instead of a line
};

struct Plot {
  std::string title;                  // for readers who do not see the drawing
  std::string x, y;                   // what the axes are, with units
  bool log_x = false, log_y = false;  // points that are not positive are left out
  std::vector<PlotSeries> series;
  std::string note;  // a sentence below; HTML
};

// A <figure>: the SVG, the numbers as JSON, the legend and the note. "" where fewer than two
// points or no width or height would be drawn. Names and labels may be hostile.
std::string PlotHtml(const Plot& plot);

}  // namespace regrade
