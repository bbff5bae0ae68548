// How much of a photo's fine detail a render keeps.
#pragma once

#include <optional>

#include "kernels/scene/image.h"

namespace regrade {

// EQ(detail-kept): with Y = 0.2126 R + 0.7152 G + 0.0722 B of the encoded values, G_s a
// Gaussian of s pixels, the photo's fine band p = Y - G_1.4 Y, and the same band of the render
// in two parts, r_1 = Y - G_0.7 Y and r_2 = G_0.7 Y - G_1.4 Y,
//   kept = sum_w E_w / sum_w <p, p>_w,
//   E_w = max over x_1, x_2 >= 0 of 2 sum_i x_i <r_i, p>_w - sum_ij x_i x_j <r_i, r_j>_w
//                                   - n_w v (x_1^2 + x_2^2),
// sums <,>_w over windows w of 16 x 16 pixels, n_w the number of pixels and v the variance of
// rounding to 8 bits. E_w is the part of the photo's energy that the render explains (the
// regression of p on r_1 and r_2, or <r, p>^2 / <r, r> with one part), so kept is in [0, 1].
//
// The render's energy is no measure: noise and sharpening raise it. Nor is <r, p> / <p, p>:
// noise does not raise it on average, but it is linear in r, which unsharp masking multiplies
// by up to 1 + amount. Here each part may be multiplied by any x_i, which is the best
// sharpening already. Noise lowers E_w; blur lowers it as it attenuates the finer half of each
// part more than the coarser, and as rounding limits x_i.
// Measured rises by unsharp masking, radius 1 and 2 pixels, amount 0.5 and 1: at most 0.0072
// on renders of a field, 0.001 on a photo, and on one that is only blurred 0.005 for 0.5 pixels
// and 0.08 for 1 pixel. A measure that is 1 for the photo and falls with every blur cannot
// avoid the last: sharpening can be the inverse of the blur, and then returns the photo.
struct FineDetail {
  std::optional<double> kept;  // [0, 1]; empty if no window counts
  std::optional<double>
      levels;  // RMS of r_1 + r_2 - p in 1 / 255 of white; empty without pixels
};

// Compares the colour channels of two images of one size (another one fails a check); one
// channel counts as grey. Pixels with a non-finite value in either image are left out of both:
// G_s is normalised over the others, as at the border. Windows in which the mean of p^2 is at
// most v do not count in `kept`: the photo is flat there.
FineDetail MeasureFineDetail(const Image& render, const Image& photo);

// One word for a photographer. The limits are what blur does to photos.
inline constexpr double kSharpFrom = 0.9, kSoftBelow = 0.5;
inline const char* SharpnessWord(double detail_kept) {
  if (detail_kept >= kSharpFrom) return "sharp";
  return detail_kept >= kSoftBelow ? "slightly soft" : "soft";
}

}  // namespace regrade
