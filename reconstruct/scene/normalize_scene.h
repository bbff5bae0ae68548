// Where the scene is: a similarity that puts it upright into a box of half size 1, and how near
// a camera it begins.
#pragma once

#include <string>

#include "kernels/scene/camera.h"
#include "kernels/scene/capture.h"
#include "reconstruct/scene/scene_box.h"

namespace regrade {

struct NormalizedScene {
  Similarity field_from_world;  // the field's frame: z up, y the cameras' mean heading as far
                                // as one exists
  NdcSpace ndc;                 // on: the box is in normalised device coordinates of that frame
  SceneBox box;                 // in the field's frame; its longest half side is 1
  std::string notice;           // what was fallen back on, if anything
};

// From camera poses and triangulated points, order-free. The box holds all but the outermost
// hundredth of the points on each side, and most corners of the photos at the depth of their
// nearer points; with fewer than 50 points it is the cube round the optical axes' common point
// that reaches the cameras. It survives collinear cameras (H129), cameras at one point (H130)
// and ups that cancel (H131).
NormalizedScene NormalizeScene(const Capture& capture);

// What the cameras stand round, and how much of what they see lies far beyond it.
struct Surroundings {
  Vec3d center;          // world: the optical axes' common point
  double half = 0;       // world: half side of the cube that reaches the cameras; 0: unknown
  double far_share = 0;  // of all observations of points: farther out than kFarSides halves
};
// Beyond this many half sides of that cube, a box round everything would leave what the cameras
// stand round less than a quarter of its voxels a side.
inline constexpr double kFarSides = 4;
inline constexpr double kFarShare = 0.05;  // more than this, and the scene has a background
// Free of the photos' order. A capture without points has no far share.
Surroundings MeasureSurroundings(const Capture& capture);

// The cube as the box, for a scene whose background is on spheres: the field's frame has y up,
// so that the spheres' poles are where few photos look.
NormalizedScene NormalizeSurrounded(const Capture& capture, const Surroundings& surroundings);

}  // namespace regrade
