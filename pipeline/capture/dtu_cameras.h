// cameras.npz of DTU scenes, in the layout of IDR (Yariv et al. 2020): world_mat_0 is picture
// 0's projection K [R | t] of the world, scale_mat_0 leads from the unit sphere around the
// object to the world.
#pragma once

#include <map>
#include <string>

#include "kernels/scene/camera.h"

namespace regrade {

// Cameras by the pictures' numbers, in the frame of the unit sphere where all have a scale_mat.
// Sizes are left out: the file has none. Throws Error(kInput): no world_mat, a matrix of
// another type or shape or with a value that is not finite, one that is no projection, skewed
// pixels.
std::map<int, Camera> ReadDtuCameras(const std::string& path);

// K [R | t] of `projection` [3, 4], known up to a factor. Throws Error(kInput).
Camera CameraOfProjection(const double* projection, const std::string& where);

}  // namespace regrade
