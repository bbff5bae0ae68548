// Where the scene is: a similarity that puts it upright into a box of half size 1, and how near
// a camera it begins.
#pragma once

#include <string>

#include "kernels/scene/camera.h"
#include "kernels/scene/capture.h"
#include "reconstruct/scene_box.h"

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

}  // namespace regrade
