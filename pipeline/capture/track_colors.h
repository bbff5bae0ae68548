// Colours of the scene's tracked points in each photo that observes them.
#pragma once

#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/refinement/exposure.h"

namespace regrade {

// Linear light at (u, v), in pixels, of an sRGB photo: the mean of a window of 5 x 5 pixels
// around it, bilinearly interpolated. False if the window leaves the photo, or has a pixel near
// black or white, where light was clipped or is mostly rounding.
bool WindowLight(const Image& photo, double u, double v, Vec3d* light);

struct TrackColors {
  // One entry for each point and photo that observes it unclipped; `point` is the index into
  // capture.points.
  std::vector<ColorObservation> observations;
  std::vector<Vec3d> clipped;  // fraction of clipped pixels of each view, by channel
};

// Reads every photo once. Throws Error(kInput).
TrackColors ReadTrackColors(const Capture& capture);

}  // namespace regrade
