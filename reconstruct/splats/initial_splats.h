// The splats that a fit begins with.
#pragma once

#include "kernels/splats/splats.h"
#include "reconstruct/fit/training_rays.h"
#include "reconstruct/scene/scene_box.h"
#include "reconstruct/splats/splat_fit_options.h"
#include "reconstruct/splats/splat_photos.h"

namespace regrade {

// Without this many points, splats begin at random places that two photos see. With few points
// they do not: what begins in the air between the cameras explains single photos, and stays
// there (6 dB on the flash photos, of 500 points).
inline constexpr size_t kLeastPoints = 50;
inline constexpr size_t kRandomStarts = 20000;
// Where much is far outside of the box, at most this share of the splats begins on a sphere
// around it, of this radius over the box's longest half side: the sky, which has no points.
// Only directions are taken in which at least kFewestAgreeing photos, and half of those that
// look there, are within kAgreement of their median colour in each channel. Without that, the
// sphere explained near things and cost 0.5 to 6 dB on real captures.
inline constexpr double kFarShare = 0.125, kFarRadius = 6;
inline constexpr size_t kFewestAgreeing = 3;
inline constexpr float kAgreement = 0.06f;

// One for each point that the photos saw, of the mean colour of the pixels that show it, round,
// as wide as initial_scale times the root mean square of the distances to its three nearest
// neighbours; with surroundings also one for each direction, evenly, in which photos agree.
// Harmonics of degree 0. Throws Error(kScene) if no place is seen by two photos.
Splats InitialSplats(const std::vector<TrainingView>& views, const SplatPhotos& photos,
                     const SceneBox& box, const SplatFitOptions& options);

struct CameraSpread {
  Vec3d middle;       // the cameras' mean
  double extent = 0;  // 1.1 times the largest distance from it, as the published rates expect;
                      // at least a hundredth of the box
};
CameraSpread SpreadOf(const SplatPhotos& photos, const SceneBox& box);

}  // namespace regrade
