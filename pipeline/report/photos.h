// The photos' section of the report page: the status of each, thumbnails, and a map of the
// cameras.
#pragma once

#include <string>

#include "pipeline/report/data.h"
#include "pipeline/report/page_pictures.h"

namespace regrade {

// "" without photos. File names and reasons may be hostile.
std::string PhotosHtml(const RunReport& report, const ReportPictures& pictures);

}  // namespace regrade
