// Resampling a picture to another size: area averaging where it shrinks, bilinear where it
// grows.
#pragma once

#include "kernels/scene/image.h"

namespace regrade {

// The picture at width x height pixels, same channels. Each axis is treated by itself:
//   shrinking  every new pixel is the mean of what it covers, fractions of pixels by their
//              coverage, so the mean of the whole picture is kept exactly up to rounding;
//   growing    bilinear between pixel centres (at +0.5), edges repeated;
//   unchanged  values pass bit for bit.
// Sums are in double. With 4 channels colours are weighted by alpha, so that what lies under
// transparent pixels does not leak. Values are averaged as they are encoded (sRGB), which is
// what photo tools and COLMAP do. Sizes must be positive.
Image Resize(const Image& source, int width, int height);

}  // namespace regrade
