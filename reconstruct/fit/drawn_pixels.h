// Which pixels of a photo training rays are drawn from.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "kernels/base/vec.h"
#include "kernels/scene/image.h"

namespace regrade {

// Indices y W + x, ascending, of `photo` (3 channels, sRGB): without the masked pixels, which
// have a non-finite value. Where the background's colour (sRGB) is known, of the pixels that
// show it and nothing else within 8 pixels, one in four is drawn: they say only that their rays
// are free, and most of a photo of an object consists of them.
std::vector<int32_t> DrawnPixels(const Image& photo, const std::optional<Vec3f>& background);

}  // namespace regrade
