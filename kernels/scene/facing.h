// The place of a camera that looks along a direction.
#pragma once

#include "kernels/scene/camera.h"

namespace regrade {

// camera_from_world of a camera at `center`; `forward` and `right` are orthogonal unit vectors.
inline RigidTransform Facing(const Vec3d& center, const Vec3d& forward, const Vec3d& right) {
  RigidTransform camera_from_world;
  Mat3d& rotation = camera_from_world.rotation;
  rotation.row[0] = right;
  rotation.row[1] = Cross(forward, right);  // down
  rotation.row[2] = forward;
  camera_from_world.translation = -(rotation * center);
  return camera_from_world;
}

}  // namespace regrade
