// Optical flow between two frames, with the methods of OpenCV's own video module and, where it
// is installed, of the contributed module optflow.
#pragma once

#include <string>

#include "evaluate/flow_field.h"
#include "kernels/scene/image.h"

namespace regrade {

inline constexpr const char* kFlowMethods =
    "dis-ultrafast|dis-fast|dis-medium|dis-tuned|farneback";
// Of optflow.
inline constexpr const char* kContributedFlowMethods = "deepflow|tvl1|pca-flow|rlof";

// Pixels; below, the coarsest grid of patches of DIS is empty.
inline constexpr int kLeastFlowSide = 12;

// Motion from `from` to `to`, for every pixel of `from`. Both are turned to 8-bit grey as
// OpenCV does it for 8-bit RGB files (an alpha channel is ignored), so the flow is the one that
// any user of OpenCV gets for the same files. The result is the same for any number of threads.
//
// dis-tuned is dis-medium with finest scale 0, patch stride 3, 10 variational iterations and
// spatial propagation: half the end-point error on large motion for five times the time.
//
// Flow is always some flow: two unrelated pictures give finite vectors too. Check it both ways
// (evaluate/occlusion.h) before use.
//
// Errors: kUsage for an unknown method, or one that this build lacks; kInput for sizes that
// differ or are below 12 pixels.
FlowField ComputeFlow(const Image& from, const Image& to, const std::string& method);

}  // namespace regrade
