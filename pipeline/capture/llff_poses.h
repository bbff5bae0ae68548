// poses_bounds.npy, the camera file of LLFF captures (Mildenhall et al. 2019).
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/camera.h"

namespace regrade {

struct LlffPoses {
  std::vector<Camera> cameras;  // pinholes at the size given in the file, in its order
  double nearest = 0;           // smallest near bound, world units
  double farthest = 0;          // largest of the far bounds
};

// f64 [N, 17]: by rows a 3x5 matrix (camera-to-world with axes down, right, backward; then
// height, width and focal length in pixels) and the near and far depth of the visible scene.
// Rotations are made orthonormal. Throws Error(kInput) for another shape or type, values that
// are not finite, a matrix that is no rigid motion, an implausible size, or bounds that are not
// 0 < near < far.
LlffPoses ReadPosesBounds(const std::string& path);

}  // namespace regrade
