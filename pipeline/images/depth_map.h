// Depth maps as NumPy's .npy files.
#pragma once

#include <string>

#include "kernels/scene/image.h"

namespace regrade {

// An array [height, width] (or with a last dimension of 1) of float32 or float64, with one
// channel. Throws Error(kInput) for another array or size and for a damaged file.
Image ReadDepthMap(const std::string& path, int width, int height);

// `depth` has one channel; float32. Throws Error(kResources).
void WriteDepthMap(const std::string& path, const Image& depth);

}  // namespace regrade
