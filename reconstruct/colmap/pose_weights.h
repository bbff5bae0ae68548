// Estimates the relative time of the pose steps, for progress.
#pragma once

#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_strategies.h"

namespace regrade {

// Approximate seconds on two cores.
struct PoseWeights {
  double extract, match, map, refine;
  double Sum() const { return extract + match + map + refine; }
};

// image_size: longer side at which features are extracted, pixels.
PoseWeights EstimateWeights(const PoseStrategy& strategy,
                            const std::vector<StagedPhoto>& photos, int image_size);

}  // namespace regrade
