// Images of a model whose camera cannot be where the model has it.
#pragma once

#include <string>
#include <vector>

#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

struct FarCamera {
  std::string image;
  double times = 0;  // as far from the others' middle as they are in the median
};

// Takes images out whose camera is more than 50 times as far from the cameras' middle as the
// median one, unless the points confirm it: at least ten of its observations, and half of them,
// are projected to within a hundredth of the picture's longer side. One such camera would
// stretch the scene's box until nothing is left in it. At most a quarter of the images: more
// are a scene of two parts, and stay.
std::vector<FarCamera> TakeOutFarCameras(ColmapModel* model);

}  // namespace regrade
