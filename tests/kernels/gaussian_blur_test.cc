#include "kernels/image/gaussian_blur.h"

#include <gtest/gtest.h>

#include <cmath>

namespace regrade {
namespace {

// A point becomes the Gaussian: its standard deviation, within what the cut at 3 sigma takes,
// 1.5 % of the variance, and its sum.
TEST(GaussianBlur, APointBecomesAGaussian) {
  const double sigma = 3;
  Image point(61, 41, 1);
  *point.at(30, 20) = 1;
  const Image blurred = GaussianBlur(point, sigma);
  double sum = 0, variance_x = 0, variance_y = 0;
  for (int y = 0; y < 41; ++y)
    for (int x = 0; x < 61; ++x) {
      const double value = *blurred.at(x, y);
      sum += value;
      variance_x += value * (x - 30) * (x - 30);
      variance_y += value * (y - 20) * (y - 20);
    }
  EXPECT_NEAR(sum, 1, 1e-5);  // floats of 41 x 61 pixels
  EXPECT_NEAR(variance_x, sigma * sigma, 0.03 * sigma * sigma);
  EXPECT_NEAR(variance_y, sigma * sigma, 0.03 * sigma * sigma);
  EXPECT_NEAR(*blurred.at(33, 20) / *blurred.at(30, 20), std::exp(-0.5), 1e-5);
}

// At the border, too: a constant picture of 1 to 4 channels, smaller than the Gaussian.
TEST(GaussianBlur, AConstantStays) {
  for (int channels = 1; channels <= 4; ++channels) {
    Image flat(7, 3, channels);
    for (size_t i = 0; i < flat.pixels.size(); ++i)
      flat.pixels[i] = 0.2f + 0.1f * static_cast<float>(i % channels);
    const Image blurred = GaussianBlur(flat, 5);
    for (size_t i = 0; i < flat.pixels.size(); ++i)
      EXPECT_FLOAT_EQ(blurred.pixels[i], flat.pixels[i]);
  }
}

}  // namespace
}  // namespace regrade
