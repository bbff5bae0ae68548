#include "kernels/base/half.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace regrade {
namespace {

TEST(Half, EveryHalfSurvivesTheRoundTrip) {
  for (uint32_t bits = 0; bits < 0x10000; ++bits) {
    const uint16_t half = static_cast<uint16_t>(bits);
    const float value = FloatFromHalf(half);
    if (std::isnan(value)) {
      EXPECT_TRUE(std::isnan(FloatFromHalf(HalfFromFloat(value))));
    } else {
      ASSERT_EQ(HalfFromFloat(value), half);
    }
  }
}

// Between two neighbouring halves, the nearer one is chosen, and the even one at the middle.
TEST(Half, RoundsToNearestTiesToEven) {
  for (uint16_t half = 0; half < 0x7bff; ++half) {
    const double low = FloatFromHalf(half), high = FloatFromHalf(half + 1);
    const float middle = static_cast<float>((low + high) / 2);  // exact: 12 bits
    const uint16_t even = (half & 1) ? half + 1 : half;
    ASSERT_EQ(HalfFromFloat(middle), even) << half;
    ASSERT_EQ(HalfFromFloat(std::nextafter(middle, 0.0f)), half) << half;
    ASSERT_EQ(HalfFromFloat(std::nextafter(middle, 1e30f)), half + 1) << half;
    ASSERT_EQ(HalfFromFloat(-middle), even | 0x8000) << half;
  }
}

TEST(Half, LargeValuesBecomeInfinity) {
  EXPECT_EQ(HalfFromFloat(kMaxHalf), 0x7bff);
  EXPECT_EQ(HalfFromFloat(65519.99f), 0x7bff);
  EXPECT_EQ(HalfFromFloat(65520.0f), 0x7c00);
  EXPECT_EQ(HalfFromFloat(-std::numeric_limits<float>::infinity()), 0xfc00);
  EXPECT_EQ(HalfFromFloat(std::ldexp(1.0f, -25)), 0);  // a tie, zero is even
  EXPECT_EQ(HalfFromFloat(std::nextafter(std::ldexp(1.0f, -25), 1.0f)), 1);
}

}  // namespace
}  // namespace regrade
