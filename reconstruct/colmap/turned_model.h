// Turns the images of a model with their pictures.
#pragma once

#include <map>
#include <string>

#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// Where the image point (*u, *v) of a stored picture of width x height pixels is in the upright
// one, by EXIF orientation 1..8.
void TurnPoint(int orientation, double width, double height, double* u, double* v);

// Whether an EXIF orientation turns a picture without mirroring it.
inline bool IsTurn(int orientation) {
  return orientation == 3 || orientation == 6 || orientation == 8;
}

// `orientations`: by image names, turns (IsTurn), of pictures as stored. Those images see the
// same afterwards as cameras of the upright pictures: camera_from_world, intrinsics and
// keypoints are turned. Cameras that no image uses any more are removed.
void TurnUpright(const std::map<std::string, int>& orientations, ColmapModel* model);

}  // namespace regrade
