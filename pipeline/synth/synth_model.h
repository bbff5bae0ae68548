// A COLMAP model of a synthetic capture: tracks as features give them, and poses as people hand
// them over.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/scene/image.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// The true cameras, some kTracksAView points on what each of them sees, and for each point the
// keypoints of all views whose depth agrees, off by kSynthTrackSigma pixels each way.
inline constexpr int kTracksAView = 150;
ColmapModel TracksOf(const std::vector<Camera>& cameras, const std::vector<Image>& depths,
                     const std::vector<std::string>& names, uint64_t seed);

// The same with every camera turned by kSynthPoseTurn about an axis of its own and moved by
// kSynthPoseStep in a direction of its own.
ColmapModel ShakenModel(const ColmapModel& model, uint64_t seed);

}  // namespace regrade
