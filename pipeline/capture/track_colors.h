// What the scene's tracked points look like in each photo that sees them.
#pragma once

#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/refinement/exposure.h"

namespace regrade {

// Linear light at the point (u, v), in pixels, of an sRGB photo: the mean of a window of 5 x 5
// pixels round it, which lies between pixels (bilinear). False where the window leaves the
// photo, or holds a pixel that is near black or white: there light was clipped, or is mostly
// rounding.
bool WindowLight(const Image& photo, double u, double v, Vec3d* light);

struct TrackColors {
  // One entry for each point and photo that sees it and shows it unclipped; `point` is the
  // index into capture.points.
  std::vector<ColorObservation> observations;
  std::vector<Vec3d> clipped;  // of each view: the share of its pixels that are, by channel
};

// Reads every photo once. Throws Error(kInput).
TrackColors ReadTrackColors(const Capture& capture);

}  // namespace regrade
