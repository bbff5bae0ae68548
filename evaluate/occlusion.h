// Which pixels of a frame can be trusted to be the same surface in another frame, from the flow
// in both directions.
#pragma once

#include <cstdint>
#include <string>

#include "evaluate/flow_field.h"
#include "kernels/scene/image.h"

namespace regrade {

struct OcclusionMask {
  Image weight;  // one channel in [0, 1], on the first frame's grid; 1 means "same surface"

  // Pixels by what speaks against them. In mode lai2018 a pixel may be both out of frame and
  // trusted; otherwise each pixel is counted under the first of these that applies.
  int64_t not_finite = 0;       // its flow, or the backward flow it arrives at, is unknown
  int64_t out_of_frame = 0;     // its target lies outside the second frame
  int64_t disoccluded = 0;      // forward and backward flow disagree, or the depth test failed
  int64_t motion_boundary = 0;  // the flow changes too fast around it

  double Coverage() const;  // mean weight, in [0, 1]
};

// EQ(occlusion-lai2018): Lai et al., ECCV 2018, as their released evaluator computes it, after
// Sundaram et al. 2010. With f the forward flow and w(x) = b(x + f(x)) the backward flow
// sampled where x arrives (bilinear, border repeated), the weight is 0 where
//   |w + f|^2 > 0.01 (|w|^2 + |f|^2) + 0.5                 or
//   |grad f|^2 > 0.01 |f|^2 + 0.002,
// and 1 elsewhere. |grad f|^2 sums the squared forward differences in x and y of both
// components, 0 behind the last column and row. Targets out of the frame are counted, not
// masked: the original does not mask them either. Flow that is not finite has weight 0.
OcclusionMask MaskLai2018(const FlowField& forward, const FlowField& backward);

// EQ(occlusion-ruder2016): Ruder et al., GCPR 2016, as their consistency checker computes it.
// First a value for each pixel a, arriving at b = a + f(a):
//      0   if one of the four taps around b is outside the frame, or the flow is not finite;
//   -255   if |f(a) + w(a)|^2 >= 0.01 (|f(a)|^2 + |w(a)|^2) + 0.5;
//      0   if the squared central differences (weights -1/2, 0, 1/2) of both components in x
//          and y sum to more than 0.01 |f(a)|^2 + 0.002;
//    255   otherwise.
// Then Gaussian smoothing, sigma 0.8: separable, taps exp(-k^2 / (2 sigma^2)) for k = -2..2
// divided by their sum. Both filters continue the picture by mirroring at the border's outer
// edge (index -1 reads 0, index -2 reads 1). Then clipped to [0, 255] and divided by 255,
// without rounding to bytes. The negative start makes the untrusted zone grow.
// Our one addition: pixels whose target cannot be sampled, or whose flow is not finite, keep
// weight 0 after the smoothing.
OcclusionMask MaskRuder2016(const FlowField& forward, const FlowField& backward);

// The mask's formula in one line, for reports. `mode` is lai2018, ruder2016 or geometry.
std::string MaskFormula(const std::string& mode);

}  // namespace regrade
