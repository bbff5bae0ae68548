// The consistency of a pair by forward warping, in two readings: as StyleGaussian's authors
// published it, and corrected.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "evaluate/flow_field.h"
#include "kernels/scene/image.h"

namespace regrade {

// A frame moved onto the grid of another one.
struct MovedFrame {
  Image color;   // [H, W, C], C the 1 or 3 colour channels
  Image weight;  // [H, W, 1]: the sum that `color` was divided by; 0 where nothing arrived
};

// EQ(softmax-splat), Niklaus and Liu 2020: with b_xy the bilinear weight that x + f(x) gives
// the pixel y and s(x) an importance, W(y) = sum_x b_xy e^s(x) I(x) / (n(y) + bias), n(y) =
// sum_x b_xy e^s(x). Here, with values from 0 to 255, s = max(-10, -10 mean_c |A(x) - B(x + k
// f(x))|): B is sampled bilinearly with zeros outside. `first` and `second` are A and B;
// `moved` is I. k = `scale` per axis. Where n = 0, W = 0. Pixels with flow or a colour that is
// not finite are not moved. Images and flow are of one size.
MovedFrame SoftmaxSplat(const Image& moved, const Image& first, const Image& second,
                        const FlowField& flow, double scale_x, double scale_y, double bias);

// The errors of one pair by one reading; rmse with white = 1.
struct WarpedError {
  std::optional<double> rmse, lpips;  // empty if no pixel is compared; lpips without a network
  double coverage = 0;                // fraction of the pixels inside the mask, in [0, 1]
};
using PairDistance = std::function<double(const Image&, const Image&)>;

// EQ(warped-rmse-published), the comment of 26 April 2024 on StyleGaussian's issue 5: W is the
// earlier frame splatted by k = width / (width - 1), height / (height - 1) and bias 1e-7; M(y)
// = 0 where the channels of W(y) sum to exactly 0, else 1; rmse = sqrt(mean over all pixels and
// channels of (W - M I_later)^2). `lpips` gets W and M I_later with values from 0 to 255.
// Frames and flow (of the measured frames, to the later one) are those of PadFrame.
WarpedError PublishedWarpedError(const Image& earlier, const Image& later,
                                 const FlowField& flow, const PairDistance& lpips);

// EQ(warped-rmse): flow and importance are those of the unstyled frames, k = 1, bias 0, M = 1
// where n > 0 and the colours are finite; rmse = sqrt(sum_y M |W - I_later|^2 / (C sum_y M)).
// `lpips` gets frames from 0 to 1, W = I_later where M = 0, and is divided by the mean of M.
WarpedError CorrectedWarpedError(const Image& earlier, const Image& later,
                                 const Image& unstyled_earlier, const Image& unstyled_later,
                                 const FlowField& flow, const PairDistance& lpips);

// With sides that are multiples of 8, the border repeated on both sides, as RAFT's
// demonstration does it. Only colour channels are kept.
Image PadFrame(const Image& frame);
FlowField PadFlow(const FlowField& flow);

}  // namespace regrade
