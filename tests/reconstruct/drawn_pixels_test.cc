#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "reconstruct/fit/training_rays.h"

namespace regrade {
namespace {

TEST(DrawnPixels, AllThatAreNotMasked) {
  Image photo(60, 40, 3);
  std::ranges::fill(photo.pixels, 1.0f);
  photo.at(50, 34)[2] = std::numeric_limits<float>::quiet_NaN();
  const std::vector<int32_t> drawn = DrawnPixels(photo);
  EXPECT_EQ(std::ssize(drawn), photo.num_pixels() - 1);
  EXPECT_TRUE(std::ranges::is_sorted(drawn));
  EXPECT_FALSE(std::ranges::binary_search(drawn, 34 * photo.width + 50));
}

}  // namespace
}  // namespace regrade
