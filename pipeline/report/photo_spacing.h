// How far apart the photos of a capture are, and which were not placed: what to add to it.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"

namespace regrade {

// Neighbouring photos share two thirds of what they show up to about this, in radians.
inline constexpr double kFarApart = 0.35;

struct PhotoSpacing {
  // The neighbours that are farthest apart, the user's file names; empty for fewer than two
  // photos. Photos are neighbours where no third one is nearer to both.
  std::string before, after;
  // Of these two: the angle between their optical axes or their distance over that to the
  // scene, whichever is larger, in radians.
  double widest = 0;
  std::vector<std::string> not_placed;  // usable files without a pose

  bool far_apart() const { return widest > kFarApart; }
};

// The distance to the scene is the median one to the points that a photo sees; without points,
// that to the place that the optical axes pass most closely.
PhotoSpacing SpacingOf(const Capture& capture);

}  // namespace regrade
