// PSNR of two pictures, for tests that link no metrics.
#pragma once

#include <cmath>

#include "kernels/scene/image.h"

namespace regrade::testing {

// Over all pixels and channels, in dB; both pictures have one size.
inline double Psnr(const Image& a, const Image& b) {
  double sum = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i)
    sum += std::pow(double{a.pixels[i]} - double{b.pixels[i]}, 2);
  return -10 * std::log10(sum / static_cast<double>(a.pixels.size()));
}

}  // namespace regrade::testing
