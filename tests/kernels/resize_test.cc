#include "kernels/image/resize.h"

#include <gtest/gtest.h>

#include <numeric>

#include "kernels/base/random.h"
#include "tests/support/pictures.h"

namespace regrade {
namespace {

double Mean(const Image& image) {
  return std::accumulate(image.pixels.begin(), image.pixels.end(), 0.0) / image.pixels.size();
}

TEST(Resize, SameSizeIsBitwiseTheSame) {
  const Image image = testing::NoiseImage(17, 9, 3, 3);
  EXPECT_EQ(Resize(image, 17, 9).pixels, image.pixels);
}

TEST(Resize, ShrinkingByCoverageIsExact) {
  Image image(3, 1, 1);
  image.pixels = {0.f, 0.75f, 1.f};
  const Image two = Resize(image, 2, 1);
  // Each new pixel covers 1.5 old ones.
  EXPECT_FLOAT_EQ(two.pixels[0], static_cast<float>((0 + 0.5 * 0.75) / 1.5));
  EXPECT_FLOAT_EQ(two.pixels[1], static_cast<float>((0.5 * 0.75 + 1) / 1.5));
}

TEST(Resize, ShrinkingKeepsTheMean) {
  const Image image = testing::NoiseImage(101, 67, 3, 3);
  for (const auto& [w, h] : {std::pair{50, 67}, {7, 5}, {1, 1}, {100, 66}})
    // Float rounding of independent pixels: far below 1e-7 in the mean.
    EXPECT_NEAR(Mean(Resize(image, w, h)), Mean(image), 1e-7) << w << "x" << h;
}

TEST(Resize, ConstantStaysConstantBothWays) {
  Image image(31, 13, 3);
  for (float& v : image.pixels) v = 0.3f;
  for (const auto& [w, h] : {std::pair{7, 29}, {64, 3}, {300, 200}, {1, 1}})
    for (const float v : Resize(image, w, h).pixels) EXPECT_NEAR(v, 0.3f, 1e-7f);
}

TEST(Resize, GrowingARampIsALine) {
  Image image(4, 1, 1);
  image.pixels = {0.f, 1.f, 2.f, 3.f};
  const Image wide = Resize(image, 8, 1);
  // Centres lie at (i + 0.5) / 2 - 0.5 old pixels; edges repeat.
  const float expected[] = {0.f, 0.25f, 0.75f, 1.25f, 1.75f, 2.25f, 2.75f, 3.f};
  for (int i = 0; i < 8; ++i) EXPECT_FLOAT_EQ(wide.pixels[i], expected[i]);
}

TEST(Resize, OnePixelGrows) {
  Image image(1, 1, 3);
  image.pixels = {0.1f, 0.2f, 0.3f};
  const Image grown = Resize(image, 5, 4);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(grown.pixels[3 * i + 1], 0.2f);
}

TEST(Resize, TransparentColoursDoNotLeak) {
  Image image(2, 1, 4);
  image.pixels = {1, 0, 0, 1, /*transparent green:*/ 0, 1, 0, 0};
  const Image one = Resize(image, 1, 1);
  EXPECT_FLOAT_EQ(one.pixels[0], 1.f);
  EXPECT_FLOAT_EQ(one.pixels[1], 0.f);
  EXPECT_FLOAT_EQ(one.pixels[3], 0.5f);
}

TEST(Resize, SumsOfManyPixelsStayExact) {
  // 4 million values of 0.1f: a float sum would be off by percents.
  Image image(2000, 2000, 1);
  for (float& v : image.pixels) v = 0.1f;
  EXPECT_FLOAT_EQ(Resize(image, 1, 1).pixels[0], 0.1f);
}

}  // namespace
}  // namespace regrade
