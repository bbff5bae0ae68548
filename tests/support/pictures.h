// Pictures of one value, of one colour and of noise, and how pictures differ.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"
#include "kernels/base/vec.h"
#include "kernels/scene/image.h"

namespace regrade::testing {

inline Image ConstantImage(int width, int height, float value, int channels = 3) {
  Image image(width, height, channels);
  for (float& p : image.pixels) p = value;
  return image;
}

inline Image OneColour(int width, int height, const Vec3d& color) {
  Image image(width, height);
  for (size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<float>(color[static_cast<int>(i % 3)]);
  return image;
}

inline Image NoiseImage(int width, int height, uint64_t seed, int channels = 3) {
  Image image(width, height, channels);
  for (size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<float>(RandomDouble(seed, 0, i));
  return image;
}

inline double LargestDifference(const Image& a, const Image& b) {
  EXPECT_TRUE(a.SameSize(b) && a.channels == b.channels);
  double largest = a.pixels.size() == b.pixels.size() ? 0 : INFINITY;
  for (size_t i = 0; i < a.pixels.size() && i < b.pixels.size(); ++i)
    largest = std::max(largest, std::abs(double{a.pixels[i]} - double{b.pixels[i]}));
  return largest;
}

inline double MeanDifference(const Image& a, const Image& b) {
  EXPECT_TRUE(a.SameSize(b) && a.channels == b.channels);
  double sum = a.pixels.size() == b.pixels.size() ? 0 : INFINITY;
  for (size_t i = 0; i < a.pixels.size() && i < b.pixels.size(); ++i)
    sum += std::abs(double{a.pixels[i]} - double{b.pixels[i]});
  return sum / static_cast<double>(a.pixels.size());
}

}  // namespace regrade::testing
