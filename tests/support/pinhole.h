// Cameras without distortion at the origin of the world.
#pragma once

#include "kernels/scene/camera.h"

namespace regrade::testing {

// Pixels.
inline Camera PinholeOf(int width, int height, double focal, double cx, double cy) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = focal;
  camera.cx = cx;
  camera.cy = cy;
  return camera;
}

// With its principal point in the middle.
inline Camera PinholeOf(int width, int height, double focal) {
  return PinholeOf(width, height, focal, 0.5 * width, 0.5 * height);
}

}  // namespace regrade::testing
