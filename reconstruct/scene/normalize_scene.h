// Places the scene upright in a box of half size 1, and finds its near clip.
#pragma once

#include <string>

#include "kernels/scene/camera.h"
#include "kernels/scene/capture.h"
#include "reconstruct/scene/scene_box.h"

namespace regrade {

struct NormalizedScene {
  Similarity field_from_world;  // the field's frame: z up, y the cameras' mean heading if any
  NdcSpace ndc;                 // on: the box is in normalised device coordinates of that frame
  SceneBox box;                 // in the field's frame; its longest half side is 1
  std::string notice;           // the fallback that was used, if any
};

// From camera poses and triangulated points, in any order. The box is the given one, turned
// upright and widened by 8 % of its extent on each side; without one it contains the points
// except the outermost hundredth on each side, and most corners of the photos at the depth of
// their nearer points. With fewer than 50 points it is a cube around the optical axes' common
// point that extends to the cameras. Valid for collinear cameras (H129), cameras at one point
// (H130) and up vectors that cancel (H131).
NormalizedScene NormalizeScene(const Capture& capture);

// The region that the cameras surround, and how much of the scene is far outside of it.
struct Surroundings {
  Vec3d center;     // world: the optical axes' common point
  double half = 0;  // world: half side of the cube that extends to the cameras; 0: unknown
  double far_fraction = 0;  // of all observations: farther out than kFarSides half sides
};
// A box that contains points beyond this many half sides would leave the surrounded region less
// than a quarter of the voxels along each side.
inline constexpr double kFarSides = 4;
inline constexpr double kFarFraction = 0.05;  // above it, the scene has a background
// Independent of the order of photos. far_fraction is 0 without points. camera_range: the
// cameras' median distance in half sides; 0: 0.9, or less where the cameras look outwards.
Surroundings MeasureSurroundings(const Capture& capture, double camera_range = 0);

// Uses the cube as the box, for a scene with background spheres. The field's frame has y up, so
// that few photos see the spheres' poles.
NormalizedScene NormalizeSurrounded(const Capture& capture, const Surroundings& surroundings);

}  // namespace regrade
