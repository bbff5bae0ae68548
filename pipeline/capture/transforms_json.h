// transforms.json, the camera file of nerfstudio, instant-ngp and the Blender captures.
//
// Its matrices are camera-to-world with OpenGL axes (x right, y up, z backward); ours are
// camera_from_world with OpenCV axes. The world frame is kept as it is.
#pragma once

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "kernels/scene/camera.h"

namespace regrade {

struct TransformsFrame {
  std::string file;  // relative to the folder of the file, as the picture is called on disk
  Camera camera;
  std::string mask = {};   // likewise, by "mask_path"; empty: none
  std::string depth = {};  // likewise, by "depth_file_path"
};

struct TransformsFile {
  std::vector<TransformsFrame> frames;     // in the file's order; pictures that exist
  std::vector<std::string> missing;        // listed, but not there
  std::vector<std::string> missing_masks;  // likewise
  std::vector<std::string> missing_depths;
  double depth_unit = 1e-3;  // "depth_unit_scale_factor": world units
  // By "test_filenames", or "val_filenames" where there are none, and "train_filenames": files
  // of frames for tests, and of frames for neither.
  std::set<std::string> test, left;
  std::string nearest = {};  // the picture whose name is nearest to the first one missing
  // A frame whose picture has another name than the file says, and that name; or empty.
  int renamed = 0;  // how many
  std::string listed_name = {}, real_name = {};
};

// Size in pixels of a picture on disk, for files that leave out "w" and "h". If it gives 0,
// cameras are read without their size, and are not checked for plausibility.
using PictureSizeFunction =
    std::function<void(const std::string& path, int* width, int* height)>;

// Reads "frames" with "file_path" and "transform_matrix" (4x4 or 3x4); intrinsics are at the
// top or in a frame: fl_x, fl_y, cx, cy, w, h, or camera_angle_x [, camera_angle_y]; k1 k2 p1
// p2 k3 for perspective lenses, k1..k4 for OPENCV_FISHEYE. Rotations are made orthonormal to
// double precision. A file_path may have another separator or case than the picture on disk,
// another ending, or none, as in Blender captures (listed_pictures.h).
//
// Throws Error(kInput) with the place in the file: JSON that ParseJson refuses, more than 64
// MiB, values that are missing, out of range or not finite, a matrix that is no rigid motion,
// an implausible camera, an unknown lens, a picture listed twice or far from the file's folder,
// a photo for both training and tests, or, unless the file may be empty, no picture on disk.
TransformsFile ReadTransformsJson(const std::string& path,
                                  const PictureSizeFunction& size_of = {},
                                  bool may_be_empty = false);

// Intrinsics are written at the top if all cameras share them. Numbers read back exactly.
// Throws Error(kInput) for lenses that the format cannot express (kFullOpenCv beyond k3).
void WriteTransformsJson(const std::string& path, const std::vector<TransformsFrame>& frames);

}  // namespace regrade
