// Full-reference image metrics: PSNR, SSIM and gradient correlation.
#pragma once

#include <optional>

#include "kernels/scene/image.h"

namespace regrade {

// All metrics compare the colour channels (alpha is ignored) of two images of one size and
// number of channels, values as given with white = 1, sums in double. A non-finite value
// excludes every pixel, window or difference that contains it. The result is empty if nothing
// remains. Images of different size or channels fail a check.

// Mean squared error over pixels and channels. Pixels where `left_out` (one channel, may be
// null) is above 0.5 are excluded.
std::optional<double> MeanSquaredError(const Image& a, const Image& b,
                                       const Image* left_out = nullptr);

// -10 log10(MeanSquaredError) in dB; +inf for identical images.
std::optional<double> Psnr(const Image& a, const Image& b, const Image* left_out = nullptr);

// EQ(ssim), structural similarity, Wang et al. 2004: Gaussian windows 11 x 11, sigma 1.5,
// K1 = 0.01, K2 = 0.03, dynamic range 1, population (co)variances; mean over the windows fully
// inside the image and over channels, in [-1, 1]. Empty if a side is below 11 pixels.
std::optional<double> Ssim(const Image& a, const Image& b);

// Pearson correlation, over pixels, of gradient magnitudes (forward differences of the channel
// mean, without the last row and column), in [-1, 1]: 1 if edges are preserved, independent of
// their colours. Empty if an image has no edges.
std::optional<double> GradientCorrelation(const Image& a, const Image& b);

}  // namespace regrade
