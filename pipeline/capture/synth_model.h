// A COLMAP model of a synthetic capture, with noisy tracks and pose errors.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/scene/image.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// The true cameras, about kTracksPerView visible points for each, and the keypoints of each
// point in all views whose depth agrees, with noise of kSynthTrackSigma pixels in each
// coordinate.
inline constexpr int kTracksPerView = 150;
ColmapModel TracksOf(const std::vector<Camera>& cameras, const std::vector<Image>& depths,
                     const std::vector<std::string>& names, uint64_t seed);

// The model with every camera rotated by kSynthPoseTurn about a random axis and moved by
// kSynthPoseStep in a random direction.
ColmapModel PerturbedModel(const ColmapModel& model, uint64_t seed);

}  // namespace regrade
