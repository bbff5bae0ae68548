// Plausibility checks of cameras read from any file format.
#pragma once

#include <string>

#include "kernels/scene/camera.h"

namespace regrade {

// The first implausible property, worded to follow "the camera has"; empty if there is none.
// The limits admit any lens and sensor and still catch damage: focal lengths of 1/20 to 100
// times the longer side, a principal point inside the image, a translation of at most 1e12
// world units, everything finite.
std::string ImplausibleCamera(const Camera& camera);

// Finite, with a positive scale and a rotation matrix (up to the rounding of text files).
bool IsSound(const Similarity& similarity);

}  // namespace regrade
