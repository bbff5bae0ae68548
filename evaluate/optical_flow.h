// Optical flow between two frames, with the methods of OpenCV's video module and, if installed,
// of the contributed module optflow.
#pragma once

#include <string>

#include "evaluate/flow_field.h"
#include "kernels/scene/image.h"

namespace regrade {

inline constexpr const char* kFlowMethods =
    "dis-ultrafast|dis-fast|dis-medium|dis-tuned|farneback";
// In optflow.
inline constexpr const char* kContributedFlowMethods = "deepflow|tvl1|pca-flow|rlof";

// Pixels; for smaller images the coarsest patch grid of DIS is empty.
inline constexpr int kLeastFlowSide = 12;

// Motion from `from` to `to` in pixels, for every pixel of `from`. Both are converted to 8-bit
// grey as OpenCV does for 8-bit RGB files (alpha is ignored), so the flow equals OpenCV's for
// the same files. The result is the same for any number of threads.
//
// Methods: DIS (Kroeger et al. 2016) with OpenCV's presets, Farneback (2003), and those of
// optflow. dis-tuned is dis-medium with finest scale 0, patch stride 3, 10 variational
// iterations and spatial propagation: half the end-point error on large motion for five times
// the time.
//
// The result is always a finite flow, even for two unrelated images: check it in both
// directions (evaluate/occlusion.h) before use.
//
// Errors: kUsage for an unknown method, or one missing in this build; kInput if the sizes
// differ or a side is below 12 pixels.
FlowField ComputeFlow(const Image& from, const Image& to, const std::string& method);

}  // namespace regrade
