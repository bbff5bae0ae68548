// Which pixels of a photo training rays are drawn from.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/scene/image.h"

namespace regrade {

// Indices y W + x, ascending, of `photo` (3 channels, sRGB): without the masked pixels, which
// have a non-finite value.
std::vector<int32_t> DrawnPixels(const Image& photo);

}  // namespace regrade
