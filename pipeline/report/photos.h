// The photos' part of the report page: what became of each, with a thumbnail, and where they
// were taken.
#pragma once

#include <string>

#include "pipeline/report/data.h"
#include "pipeline/report/page_pictures.h"

namespace regrade {

// "" without photos. File names and reasons may be hostile.
std::string PhotosHtml(const RunReport& report, const ReportPictures& pictures);

}  // namespace regrade
