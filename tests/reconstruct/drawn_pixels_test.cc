#include "reconstruct/fit/drawn_pixels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace regrade {
namespace {

// A grey object of 10 x 6 pixels on white, and one masked pixel far from it.
Image ObjectOnWhite() {
  Image photo(60, 40, 3);
  std::ranges::fill(photo.pixels, 1.0f);
  for (int y = 10; y < 16; ++y)
    for (int x = 20; x < 30; ++x) photo.at(x, y)[1] = 0.5f;
  photo.at(50, 34)[2] = std::numeric_limits<float>::quiet_NaN();
  return photo;
}

bool IsDrawn(const std::vector<int32_t>& drawn, const Image& photo, int x, int y) {
  return std::ranges::binary_search(drawn, y * photo.width + x);
}

TEST(DrawnPixels, AllThatAreNotMaskedWithoutAKnownBackground) {
  const Image photo = ObjectOnWhite();
  const std::vector<int32_t> drawn = DrawnPixels(photo, {});
  EXPECT_EQ(std::ssize(drawn), photo.num_pixels() - 1);
  EXPECT_TRUE(std::ranges::is_sorted(drawn));
  EXPECT_FALSE(IsDrawn(drawn, photo, 50, 34));
}

TEST(DrawnPixels, OneInFourOfAKnownBackgroundFarFromTheObject) {
  const Image photo = ObjectOnWhite();
  const std::vector<int32_t> drawn = DrawnPixels(photo, Vec3f{1, 1, 1});
  EXPECT_TRUE(std::ranges::is_sorted(drawn));
  for (int y = 0; y < photo.height; ++y)
    for (int x = 0; x < photo.width; ++x) {
      const bool near_object = x >= 20 - 8 && x < 30 + 8 && y >= 10 - 8 && y < 16 + 8;
      const bool near_mask = std::abs(x - 50) <= 8 && std::abs(y - 34) <= 8;
      const bool masked = x == 50 && y == 34;
      const bool expected = !masked && (near_object || near_mask || (x % 2 == 0 && y % 2 == 0));
      EXPECT_EQ(IsDrawn(drawn, photo, x, y), expected) << x << ", " << y;
    }
}

// Another colour than the photo's own surroundings thins nothing.
TEST(DrawnPixels, AllWhereTheBackgroundIsNotShown) {
  const Image photo = ObjectOnWhite();
  EXPECT_EQ(DrawnPixels(photo, Vec3f{0, 0, 0}), DrawnPixels(photo, {}));
}

}  // namespace
}  // namespace regrade
