// The look of the report page: its style sheet and the few lines of script that it can do
// without.
#pragma once

namespace regrade {

extern const char kReportCss[];
extern const char kReportScript[];
// Draws every plot of the page by Chart.js, which must be there.
extern const char kReportPlotScript[];

}  // namespace regrade
