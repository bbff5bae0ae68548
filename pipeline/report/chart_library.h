// Chart.js, where the machine has it: the report carries it along, so that its drawings answer
// to a pointer. Without it they are still drawings.
#pragma once

#include <string>

namespace regrade {

// Where Debian's package libjs-chart.js puts it.
inline constexpr char kChartLibrary[] = "/usr/share/javascript/chart.js/chart.min.js";

// Its text, fit to stand in a <script>; "" where there is none, or nothing that could be it.
std::string ReadChartLibrary(const std::string& path = kChartLibrary);

}  // namespace regrade
