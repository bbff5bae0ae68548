// The style sheet and the script of the report page, embedded by CMake.
#pragma once

namespace regrade {

extern const char kReportCss[];     // page.css
extern const char kReportScript[];  // page.js

}  // namespace regrade
