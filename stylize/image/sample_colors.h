// Colours of a picture that stand for all of it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/base/vec.h"
#include "kernels/scene/image.h"

namespace regrade {

// At most `most` colours, evenly strided over the pixels that are finite and not transparent.
// Error(kInput) naming `where` if there is none. `heights`, where it is given, gets the height
// of each of them in the picture, from 0 at the bottom to 1 at the top.
std::vector<Vec3d> SampleColors(const Image& image, const std::string& where, int64_t most,
                                std::vector<double>* heights = nullptr);

}  // namespace regrade
