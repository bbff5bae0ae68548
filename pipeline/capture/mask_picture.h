// The picture of a mask as one number for each pixel.
#pragma once

#include <string>

#include "kernels/scene/image.h"

namespace regrade {

// The colour of a mask's pixel: its colour times its alpha, grey as three equal values.
Vec3f MaskColor(const Image& mask, int64_t pixel);

// [height, width, 1]: 1 where the mask is white, 0 where it is black or transparent: the mean
// of the colours times alpha. Of a photo that was cut out, which has colours and transparent
// parts, alpha alone counts. Throws Error(kInput) for a picture that cannot be read, and for
// one whose largest values are 1 of 255: a program that counts from 0 to 1 wrote it.
Image ReadMask(const std::string& path);

}  // namespace regrade
