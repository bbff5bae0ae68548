// How close one picture is to another: PSNR, SSIM and correlation of gradients.
#pragma once

#include <optional>

#include "kernels/scene/image.h"

namespace regrade {

// All three compare the colour channels (an alpha channel is ignored) of pictures of one size
// and kind, values as given with white = 1, sums in double. A value that is not finite makes
// the pixel, window or difference it touches left out; nothing left gives no figure.

// Mean squared error over pixels and channels. `left_out` (one channel, may be null): pixels
// with a value above 0.5 are not counted.
std::optional<double> MeanSquaredError(const Image& a, const Image& b,
                                       const Image* left_out = nullptr);

// -10 log10 of it; +inf for identical pictures.
std::optional<double> Psnr(const Image& a, const Image& b, const Image* left_out = nullptr);

// EQ(ssim): structural similarity, Wang et al. 2004: Gaussian windows 11 x 11, sigma 1.5,
// K1 = 0.01, K2 = 0.03, dynamic range 1, population (co)variances; mean over the windows that
// lie wholly inside the picture and over channels. Empty below 11 pixels.
std::optional<double> Ssim(const Image& a, const Image& b);

// Pearson correlation, over pixels, of gradient magnitudes (forward differences of the mean of
// the channels, last row and column left out): 1 when edges are where they were, whatever the
// colours. Empty where one picture has no edges.
std::optional<double> GradientCorrelation(const Image& a, const Image& b);

}  // namespace regrade
