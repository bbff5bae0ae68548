// Differences in decibels, for logs and messages; evaluate/image_quality.h has the PSNR of
// reports.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "kernels/scene/image.h"

namespace regrade {

// PSNR of a mean squared error, white = 1; 120 dB where there is none.
inline double Decibels(double mean_squared) {
  return -10 * std::log10(std::max(mean_squared, 1e-12));
}

// PSNR over all pixels and channels of two pictures of one size.
inline double DecibelsBetween(const Image& a, const Image& b) {
  double sum = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i)
    sum += std::pow(double{a.pixels[i]} - double{b.pixels[i]}, 2);
  return Decibels(sum / static_cast<double>(std::max<size_t>(a.pixels.size(), 1)));
}

}  // namespace regrade
