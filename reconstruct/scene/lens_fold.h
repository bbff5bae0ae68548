// Where a lens's distortion stops growing with the angle, within the picture.
#pragma once

#include "kernels/scene/camera.h"

namespace regrade {

// The distance in pixels from the principal point at which two rays have the same image point,
// because the distortion folds the picture over or ends before its border; the smallest over
// the corners and the middles of the sides. 0: nowhere in the picture.
double FoldRadius(const Camera& camera);

}  // namespace regrade
