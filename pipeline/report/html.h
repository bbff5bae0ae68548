// report.html: one self-contained page. It fetches nothing but the films in its folder.
#pragma once

#include <string>

#include "pipeline/report/data.h"
#include "pipeline/report/page_pictures.h"

namespace regrade {

// The whole page, UTF-8. All strings in the arguments may be hostile.
std::string ReportHtml(const RunReport& report, const ReportPictures& pictures);

}  // namespace regrade
