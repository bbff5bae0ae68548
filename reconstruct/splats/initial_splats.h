// The splats that a fit begins with.
#pragma once

#include "kernels/splats/splats.h"
#include "reconstruct/fit/training_rays.h"
#include "reconstruct/scene/scene_box.h"
#include "reconstruct/splats/splat_fit_options.h"
#include "reconstruct/splats/splat_photos.h"

namespace regrade {

// Fewer points than this are completed by random places that two photos see.
inline constexpr int kFewPoints = 10000;

// One for each point that the photos saw, of the mean colour of the pixels that show it, round,
// as wide as initial_scale times the root mean square of the distances to its three nearest
// neighbours; and random ones in the box, where there are few points. Harmonics of degree 0.
// Throws Error(kScene) if no place is seen by two photos.
Splats InitialSplats(const std::vector<TrainingView>& views, const SplatPhotos& photos,
                     const SceneBox& box, const SplatFitOptions& options);

// 1.1 times the largest distance of a camera from the cameras' mean, as the published rates
// expect; at least a hundredth of the box.
double SceneExtent(const SplatPhotos& photos, const SceneBox& box);

}  // namespace regrade
