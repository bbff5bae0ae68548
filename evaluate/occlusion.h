// Occlusion masks: the pixels of a frame whose flow, checked in both directions, leads to the
// same surface in another frame.
#pragma once

#include <cstdint>

#include "evaluate/flow_field.h"
#include "kernels/scene/image.h"

namespace regrade {

struct OcclusionMask {
  Image weight;  // one channel in [0, 1], on the first frame's grid; 1 means "same surface"

  // Numbers of pixels by reason. In mode lai2018 a pixel may be both out of frame and trusted;
  // otherwise each pixel is counted under the first reason that applies.
  int64_t not_finite = 0;       // its flow, or the backward flow it arrives at, is unknown
  int64_t out_of_frame = 0;     // its target lies outside the second frame
  int64_t disoccluded = 0;      // forward and backward flow disagree, or the depth test failed
  int64_t motion_boundary = 0;  // the flow changes too fast around it

  double Coverage() const;  // mean weight, in [0, 1]
};

// EQ(occlusion-lai2018), Lai et al., ECCV 2018, as in their released evaluator, after Sundaram
// et al. 2010. With f the forward flow and w(x) = b(x + f(x)) the backward flow sampled at the
// target of x (bilinear, border repeated), both in pixels, the weight is 0 where
//   |w + f|^2 > 0.01 (|w|^2 + |f|^2) + 0.5                 or
//   |grad f|^2 > 0.01 |f|^2 + 0.002,
// and 1 elsewhere. |grad f|^2 sums the squared forward differences in x and y of both
// components, 0 at the last column and row. Targets outside the frame are counted but not
// masked, as in the original. Non-finite flow has weight 0. Fields of different size fail a
// check.
OcclusionMask MaskLai2018(const FlowField& forward, const FlowField& backward);

// EQ(occlusion-ruder2016), Ruder et al., GCPR 2016, as in their consistency checker. First a
// value for each pixel a with target b = a + f(a) (w as above):
//      0   if one of the four taps around b is outside the frame, or the flow is not finite;
//   -255   if |f(a) + w(a)|^2 >= 0.01 (|f(a)|^2 + |w(a)|^2) + 0.5;
//      0   if the squared central differences (weights -1/2, 0, 1/2) of both components in x
//          and y sum to more than 0.01 |f(a)|^2 + 0.002;
//    255   otherwise.
// Then Gaussian smoothing, sigma 0.8: separable, taps exp(-k^2 / (2 sigma^2)) for k = -2..2
// divided by their sum. Both filters mirror the image at the border's outer edge (index -1
// reads 0, index -2 reads 1). Then clipped to [0, 255] and divided by 255, without rounding to
// bytes. The negative start value enlarges the untrusted zone. One addition to the original:
// pixels whose target cannot be sampled, or whose flow is not finite, keep weight 0 after the
// smoothing.
OcclusionMask MaskRuder2016(const FlowField& forward, const FlowField& backward);

}  // namespace regrade
