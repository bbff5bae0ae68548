// What every reader of cameras asks of them, whatever the file: numbers that a lens and a place
// can have.
#pragma once

#include <string>

#include "kernels/scene/camera.h"

namespace regrade {

// What no camera has, in words behind "the camera has"; empty if there is nothing. The window
// is wide enough for any lens and sensor, and narrow enough to catch damage: focal lengths of
// 1/20 to 100 times the longer side, a principal point in the picture, a translation of at most
// 1e12 world units, everything finite.
std::string ImplausibleCamera(const Camera& camera);

// Finite, a positive scale, and a rotation (to what files round it to).
bool IsSound(const Similarity& similarity);

}  // namespace regrade
