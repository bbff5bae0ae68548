// Detects captures whose cameras all look one way, and gives them a scene in NDC.
#pragma once

#include "kernels/scene/capture.h"
#include "reconstruct/scene/normalize_scene.h"

namespace regrade {

// NDC is chosen if both limits hold. They have a margin to where NDC fails: rays must run
// forward, and cameras must be behind the near plane.
inline constexpr double kForwardAngle = 25;  // degrees
inline constexpr double kForwardDepthFraction = 0.3;

struct ForwardFacing {
  double angle_deg = 0;       // largest angle between an optical axis and their mean
  double depth_fraction = 0;  // extent of the cameras along that mean, over the nearest depth
  // The scene's nearest depth, world units: given with the poses, or from points; 0 if unknown.
  double nearest = 0;
  bool on = false;
};
ForwardFacing MeasureForwardFacing(const Capture& capture);

// The frame of the mean camera, scaled so that the nearest depth is 4/3 (LLFF's factor 0.75),
// and the box in NDC that contains every pixel's ray. See EQ(ndc). margin: if not 0, the box
// instead reaches this fraction of the longer side beyond the mean camera's picture. Throws
// Error(kScene) with a photo's name if NDC is not valid for it (H87-H90).
NormalizedScene NormalizeForwardFacing(const Capture& capture, const ForwardFacing& measured,
                                       double margin = 0);

}  // namespace regrade
