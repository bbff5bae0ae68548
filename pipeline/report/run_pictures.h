// The pictures of a run's report page, read from its folder and made small enough to be
// carried.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/report/data.h"
#include "pipeline/report/page_pictures.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {

// Nothing where there is no such file, or one that is not a picture in colour.
std::optional<ReportPicture> PictureAt(const std::string& path);

// The maps that the rows of report.consistency name, those that are there.
std::vector<ReportHeatMap> HeatMapPictures(const Workspace& workspace, const RunReport& report);

// One for each of the photos' statuses: of those left out, and of the others kMostThumbnails
// evenly chosen. Photos that were never decoded have none.
inline constexpr int kMostThumbnails = 60;
std::vector<std::optional<ReportPicture>> Thumbnails(const Workspace& workspace,
                                                     const Capture& capture);

}  // namespace regrade
