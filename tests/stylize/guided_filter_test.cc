#include "stylize/image/guided_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"
#include "tests/support/pictures.h"
#include "tests/support/wavy_picture.h"

namespace regrade {
namespace {

using testing::LargestDifference;

TEST(GuidedFilter, AnAffineMapOfTheGuideComesBack) {
  const Image guide = testing::NoiseImage(50, 40, 1);
  Image picture(50, 40);
  for (int64_t i = 0; i < guide.num_pixels(); ++i) {
    const float* g = &guide.pixels[3 * i];
    picture.pixels[3 * i] = 0.3f * g[0] + 0.5f * g[1] - 0.1f * g[2] + 0.2f;
    picture.pixels[3 * i + 1] = 0.9f - 0.4f * g[1];
    picture.pixels[3 * i + 2] = g[2];
  }
  // eps beside the guide's variance of 1/12 shrinks slopes by a factor of 1e-7.
  const Image result = ApplyGuided(FitGuided(guide, picture, 4, 1e-8), guide);
  EXPECT_LE(LargestDifference(result, picture), 2e-6);
}

TEST(GuidedFilter, WindowsAreMeansOverReflectedPictures) {
  // A constant guide leaves the mean of means: compared with the sums written out.
  Image guide(9, 7);
  std::fill(guide.pixels.begin(), guide.pixels.end(), 0.3f);
  const Image picture = testing::NoiseImage(9, 7, 2);
  for (const int radius : {1, 3, 12}) {  // 12: wider than the picture
    const auto reflected = [](int i, int n) {
      while (i < 0 || i >= n) i = i < 0 ? -1 - i : 2 * n - 1 - i;
      return i;
    };
    const auto mean = [&](const Image& image) {
      Image result(9, 7);
      for (int y = 0; y < 7; ++y)
        for (int x = 0; x < 9; ++x)
          for (int c = 0; c < 3; ++c) {
            double sum = 0;
            for (int dy = -radius; dy <= radius; ++dy)
              for (int dx = -radius; dx <= radius; ++dx)
                sum += image.at(reflected(x + dx, 9), reflected(y + dy, 7))[c];
            result.at(x, y)[c] =
                static_cast<float>(sum / ((2 * radius + 1) * (2 * radius + 1)));
          }
      return result;
    };
    const Image result = ApplyGuided(FitGuided(guide, picture, radius, 4e-4), guide);
    EXPECT_LE(LargestDifference(result, mean(mean(picture))), 1e-6) << radius;
  }
}

TEST(GuidedFilter, AnEdgeOfTheGuideStaysInALargerOne) {
  // Halves of two colours; the coefficients are fitted small and meet a guide of three times
  // the size, where the edge is as sharp as the guide's.
  const auto halves = [](int width, int height) {
    Image image(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        for (int c = 0; c < 3; ++c) image.at(x, y)[c] = 2 * x < width ? 0.2f : 0.7f;
    return image;
  };
  const Image small = halves(40, 20), large = halves(120, 60);
  Image darker = small;
  for (float& v : darker.pixels) v *= 0.5f;
  const Image result = ApplyGuided(FitGuided(small, darker, 30, 4e-4), large);
  // eps of 4e-4 beside a variance of 0.0625 / 3 channels: less than 1 % of the edge is lost.
  EXPECT_NEAR(result.at(60, 30)[0] - result.at(59, 30)[0], 0.25, 0.0025);
}

}  // namespace
}  // namespace regrade
