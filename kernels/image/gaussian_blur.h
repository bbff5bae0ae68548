// Gaussian blur of an image.
#pragma once

#include "kernels/scene/image.h"

namespace regrade {

// The image under a Gaussian of `sigma` pixels (> 0), cut at 3 sigma, by rows and by columns,
// same channels. At the border the taps inside the image are divided by their sum. A value that
// is not finite spreads. Sums in double; the result is the same for any number of threads.
Image GaussianBlur(const Image& image, double sigma);

}  // namespace regrade
