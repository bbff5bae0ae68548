// Reads the pictures of a run's report page from its folder and encodes them to be embedded.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "kernels/scene/image.h"
#include "pipeline/report/data.h"
#include "pipeline/report/page_pictures.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {

// Nothing where there is no such file, or one that is not a colour picture.
std::optional<Image> ImageAt(const std::string& path);
std::optional<ReportPicture> PictureAt(const std::string& path);

// The existing maps that rows of metrics.consistency name.
std::vector<ReportHeatMap> HeatMapPictures(const Workspace& workspace,
                                           const EvaluationMetrics& metrics);

// One for each of the photos' statuses: for all photos that are not used, and for
// kMostThumbnails evenly chosen ones of the others. Photos that were never decoded have none.
inline constexpr int kMostThumbnails = 60;
std::vector<std::optional<ReportPicture>> Thumbnails(const Workspace& workspace,
                                                     const Capture& capture);

}  // namespace regrade
