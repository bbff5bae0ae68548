// How much of a photo's fine detail a render keeps.
#pragma once

#include <optional>

#include "kernels/scene/image.h"

namespace regrade {

// EQ(detail-kept): with the fine bands r of the render and p of the photo, band = Y - G * Y,
// Y = 0.2126 R + 0.7152 G + 0.0722 B of the encoded values and G a Gaussian of 1 pixel, and
// sums <,>_w over windows of 16 x 16 pixels,
//   kept = sum_w max(0, <r, p>_w) min(1, <r, p>_w / <r, r>_w) / sum_w <p, p>_w.
//
// With a_w = <r, p>_w / <p, p>_w, the coherent share, and g_w = <r, p>_w^2 / (<r, r>_w
// <p, p>_w), the squared coherence, this is the mean of min(a_w, g_w) weighted by the photo's
// energy <p, p>_w, in [0, 1] by Cauchy and Schwarz. A share of energy, <r, r> / <p, p>, would
// grow with noise. a_w does not on average, and g_w falls. Blur lowers a_w.
// Where r has more energy than coherence with p explains (<r, r>_w > <r, p>_w: noise, halos),
// g_w holds. It does not change if r is scaled, so amplifying a window's band gains at most
// g_w - a_w. Each window has a limit of its own: sharpening one place does not make up for
// another.
// Sharpening that moves a soft render towards the photo does raise it, as no measure can avoid
// that is 1 for the photo itself and falls with every blur: the inverse of a blur returns the
// photo.
struct FineDetail {
  std::optional<double> kept;    // [0, 1]; empty if the photo has no fine band
  std::optional<double> levels;  // RMS of r - p in 1 / 255 of white
};

// Compares the colour channels of two images of one size (another one fails a check), one
// channel counts as grey. Pixels with a non-finite value in either image are left out of both:
// G is normalised over the others, as at the border. Both members are empty if none is left.
// The photo has no fine band if the mean of p^2 is at most the variance of rounding to 8 bits.
FineDetail MeasureFineDetail(const Image& render, const Image& photo);

// One word for a photographer. The limits are what blur does to a photo: seven photos of seven
// captures, at 480 pixels, keep 0.67 to 0.77 after a Gaussian blur of 0.5 pixels, 0.18 to 0.33
// after one of 1 pixel.
inline constexpr double kSharpFrom = 0.7, kSoftBelow = 0.3;
inline const char* SharpnessWord(double detail_kept) {
  return detail_kept >= kSharpFrom ? "sharp"
         : detail_kept >= kSoftBelow ? "slightly soft"
                                     : "soft";
}

}  // namespace regrade
