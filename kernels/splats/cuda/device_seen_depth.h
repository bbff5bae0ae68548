// The gradient by depths that a photo saw, on a CUDA device; see EQ(splat-depth).
#pragma once

#include "kernels/splats/seen_depth.h"

namespace regrade {

// WriteDepthGradient of all `seen` [count], of which no two are of one pixel; pointers are to
// device memory.
void WriteDepthGradientOnDevice(const SeenDepth* seen, int64_t count, float weight,
                                const DepthPixels<const float>& picture,
                                const DepthPixels<float>& d);

}  // namespace regrade
