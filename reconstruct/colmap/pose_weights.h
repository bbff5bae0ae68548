// What the parts of finding poses take, so that progress and the time left mean something.
#pragma once

#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_strategies.h"

namespace regrade {

// Seconds on two cores, roughly.
struct PoseWeights {
  double extract, match, map, refine;
  double Sum() const { return extract + match + map + refine; }
};

// image_size: longer side at which features are found, pixels.
PoseWeights EstimateWeights(const PoseRecipe& recipe, const std::vector<StagedPhoto>& photos,
                            int image_size);

}  // namespace regrade
