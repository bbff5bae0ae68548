// Captures whose cameras all look one way: what tells them, and the space that suits them.
#pragma once

#include "kernels/scene/capture.h"
#include "reconstruct/scene/normalize_scene.h"

namespace regrade {

// NDC is chosen where both hold; every threshold has a margin to where the space fails (a ray
// must run forward, and a camera must stand behind the near plane).
inline constexpr double kForwardAngle = 25;  // degrees
inline constexpr double kForwardDepthShare = 0.3;

struct ForwardFacing {
  double angle_deg = 0;    // largest angle between an optical axis and their mean
  double depth_share = 0;  // spread of the cameras along that mean, over the nearest depth
  // Of the scene, world units: as it came with the poses, or of the nearest points; 0 unknown.
  double nearest = 0;
  bool on = false;
};
ForwardFacing MeasureForwardFacing(const Capture& capture);

// The frame of the mean camera, scaled so that the nearest depth is 4/3 (LLFF's factor 0.75),
// and the box in NDC that every pixel's ray stays in. See EQ(ndc). Throws Error(kScene) with a
// camera's name where the space is not valid (H87-H90).
NormalizedScene NormalizeForwardFacing(const Capture& capture, const ForwardFacing& measured);

}  // namespace regrade
