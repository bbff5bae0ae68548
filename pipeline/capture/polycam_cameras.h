// Cameras of Polycam's raw export: keyframes/corrected_cameras/NAME.json for each picture
// keyframes/corrected_images/NAME.jpg, or cameras/ and images/.
#pragma once

#include <string>

#include "kernels/scene/camera.h"

namespace regrade {

// "fx", "fy", "cx", "cy", "width", "height" in pixels, and "t_00" to "t_23", camera-to-world
// with ARKit's axes, which are OpenGL's (x right, y up, z backward). Throws Error(kInput) with
// the place for a number that is missing, not finite or out of range, and for a matrix that is
// no rigid motion.
Camera ReadPolycamCamera(const std::string& path);

}  // namespace regrade
