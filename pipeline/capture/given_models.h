// Given poses as a COLMAP model with one camera for each photo and no points.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/capture/capture_source.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// For the kinds that LacksPoints. Images have staged names. `nearest_depth` is set where the
// poses come with it; `missing` are pictures with a pose that are not there. Throws
// Error(kInput) if a file is malformed, or if photos and poses do not fit each other.
ColmapModel ModelOfPoses(const CaptureSource& source, const std::vector<StagedPhoto>& photos,
                         double* nearest_depth, std::vector<std::string>* missing);

}  // namespace regrade
