// Writes a still for people and other programs: PNG, JPEG, or TIFF with 16 bits, tagged as
// sRGB.
#pragma once

#include <string>

#include "kernels/scene/image.h"

namespace regrade {

// The ending of the name decides: .png, .jpg, .tif. 3 channels, sRGB, clamped to [0, 1]. The
// file has no metadata but its colour space, and appears only when it is whole. Throws
// Error(kResources).
void WriteStill(const std::string& path, const Image& image);

}  // namespace regrade
