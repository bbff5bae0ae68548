// report.html: one page that a person can keep, mail and open anywhere. It fetches nothing; its
// only neighbours are the films in the same folder.
#pragma once

#include <string>

#include "pipeline/report/data.h"
#include "pipeline/report/page_pictures.h"

namespace regrade {

// The whole page, UTF-8. Every string in the arguments may be hostile.
std::string ReportHtml(const RunReport& report, const ReportPictures& pictures);

}  // namespace regrade
