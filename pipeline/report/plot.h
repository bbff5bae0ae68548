// A plot as static SVG.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace regrade {

struct PlotPoint {
  double x = 0;
  std::optional<double> y;  // without one, a line breaks here
  std::string label;        // shown under the pointer, of dots; may be empty
};

struct PlotSeries {
  std::string name;  // without one, not in the legend
  std::vector<PlotPoint> points;
  int colour = 0;     // of the style sheet: .k0 to .k3
  bool dots = false;  // points instead of a line
};

struct Plot {
  std::string title;                  // for screen readers
  std::string x, y;                   // names of the axes, with units
  bool log_x = false, log_y = false;  // points that are not positive are left out
  std::vector<PlotSeries> series;
  std::string note;  // a sentence below; HTML
};

// A <figure>: the SVG, the legend and the note; "" with fewer than two points. Names and labels
// may be hostile.
std::string PlotHtml(const Plot& plot);

}  // namespace regrade
