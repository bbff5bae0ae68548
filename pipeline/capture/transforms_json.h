// transforms.json, the camera file of nerfstudio, instant-ngp and the Blender captures.
//
// Its matrices are camera-to-world with OpenGL axes (x right, y up, z backward); ours are
// camera_from_world with OpenCV axes. The world frame is kept as it is.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "kernels/scene/camera.h"

namespace regrade {

struct TransformsFrame {
  std::string
      file;  // as in the file, relative to its folder; with the extension it has on disk
  Camera camera;
};

struct TransformsFile {
  std::vector<TransformsFrame> frames;  // in the file's order; pictures that exist
  std::vector<std::string> missing;     // listed, but not there
};

// Size in pixels of a picture on disk, for files that leave out "w" and "h". If it gives 0,
// cameras are read without their size, and are not checked for plausibility.
using PictureSizeFunction =
    std::function<void(const std::string& path, int* width, int* height)>;

// Reads "frames" with "file_path" and "transform_matrix" (4x4 or 3x4); intrinsics are at the
// top or in a frame: fl_x, fl_y, cx, cy, w, h, or camera_angle_x [, camera_angle_y]; k1 k2 p1
// p2 k3 for perspective lenses, k1..k4 for OPENCV_FISHEYE. Rotations are made orthonormal to
// double precision. A file_path without extension means .png, .jpg or .jpeg, as in Blender
// captures.
//
// Throws Error(kInput) with the place in the file: JSON that ParseJson refuses, more than 64
// MiB, values that are missing, out of range or not finite, a matrix that is no rigid motion,
// an implausible camera, an unknown lens, a picture listed twice, or, unless the file may be
// empty, no picture on disk.
TransformsFile ReadTransformsJson(const std::string& path,
                                  const PictureSizeFunction& size_of = {},
                                  bool may_be_empty = false);

// Intrinsics are written at the top if all cameras share them. Numbers read back exactly.
// Throws Error(kInput) for lenses that the format cannot express (kFullOpenCv beyond k3).
void WriteTransformsJson(const std::string& path, const std::vector<TransformsFrame>& frames);

}  // namespace regrade
