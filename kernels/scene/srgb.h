// The sRGB transfer curve (IEC 61966-2-1), for computations in linear light.
#pragma once

#include <cmath>

#include "kernels/base/host_device.h"

namespace regrade {

// Encoded value of linear light; both in [0, 1], negative light gives 0.
HD inline double SrgbFromLinear(double linear) {
  if (!(linear > 0)) return 0;
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

// Linear light of an encoded value; both in [0, 1], negative values give 0.
HD inline double LinearFromSrgb(double encoded) {
  if (!(encoded > 0)) return 0;
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

}  // namespace regrade
