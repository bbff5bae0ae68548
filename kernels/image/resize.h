// Resampling an image to another size: area averaging to shrink, bilinear to enlarge.
#pragma once

#include "kernels/scene/image.h"

namespace regrade {

// The image at width x height pixels, same channels. The axes are independent:
//   shrinking  every new pixel is the mean of the area it covers, pixels weighted by their
//              covered fraction, so the mean of the whole image is kept up to rounding;
//   enlarging  bilinear between pixel centres (at +0.5), edges repeated;
//   unchanged  values are copied bit for bit.
// Sums are in double. With 4 channels colours are weighted by alpha, so that the colour of
// transparent pixels has no influence. Encoded (sRGB) values are averaged, as in photo tools
// and COLMAP. Sizes must be positive.
Image Resize(const Image& source, int width, int height);

}  // namespace regrade
