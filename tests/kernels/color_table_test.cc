#include "kernels/image/color_table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"
#include "tests/support/floating_point_traps.h"

namespace regrade {
namespace {

Vec3d RandomColor(uint64_t i) {
  return {RandomDouble(1, 0, i), RandomDouble(1, 1, i), RandomDouble(1, 2, i)};
}

TEST(ColorTable, AffineMapsAreInterpolatedExactly) {
  const auto affine = [](const Vec3d& c) {
    return Vec3d{0.1 + 0.5 * c.x - 0.2 * c.z, 0.9 * c.y, 0.3 * c.x + 0.4 * c.y + 0.1 * c.z};
  };
  for (const int size : {2, 3, 33}) {
    const ColorTable table = TabulateColors(size, affine);
    for (uint64_t i = 0; i < 2000; ++i) {
      const Vec3d c = RandomColor(i);
      ASSERT_LE(Norm(table(c) - affine(c)), 2e-7);  // values are floats
    }
    for (const Vec3d& corner : {Vec3d{0, 0, 0}, Vec3d{1, 1, 1}, Vec3d{1, 0, 1}})
      ASSERT_LE(Norm(table(corner) - affine(corner)), 1e-7);
  }
}

TEST(ColorTable, GreyStaysGreyAndColoursOutsideAreMovedToTheSurface) {
  ColorTable table = TabulateColors(5, [](const Vec3d& c) {
    return Vec3d{c.x * c.x, c.y * c.y, c.z * c.z};
  });
  for (double v = 0; v <= 1; v += 0.01) {
    const Vec3d grey = table({v, v, v});
    ASSERT_NEAR(grey.x, grey.y, 1e-15);
    ASSERT_NEAR(grey.x, grey.z, 1e-15);
  }
  EXPECT_EQ(table({-3, 0.5, 7}), table({0, 0.5, 1}));
  table.low = {-1, -1, -1};
  table.high = {3, 3, 3};
  EXPECT_NEAR(table({1, 1, 1}).x, 0.25, 1e-15);
}

TEST(ColorTable, SteepestSlopeIsReachedAndNeverExceeded) {
  const ColorTable table = TabulateColors(9, [](const Vec3d& c) {
    return Vec3d{std::pow(c.x, 3), 0.5 * c.y + 0.3 * c.x * c.z, std::sqrt(c.z)};
  });
  const double slope = SteepestSlope(table);
  double largest = 0;
  for (uint64_t i = 0; i < 100000; ++i) {
    const Vec3d a = RandomColor(i);
    const Vec3d b = a + (RandomColor(i + 1000000) - Vec3d{0.5, 0.5, 0.5}) * 0.02;
    largest = std::max(largest, Norm(table(a) - table(b)) / Norm(a - b));
  }
  EXPECT_LE(largest, slope * (1 + 1e-6));
  EXPECT_GE(largest, 0.9 * slope);
  EXPECT_NEAR(SteepestSlope(TabulateColors(17, [](const Vec3d& c) { return c * 2.0; })), 2,
              1e-5);
  EXPECT_GE(SteepestSlope(table, 0.5), 0.5);  // ends early, above what is enough
}

}  // namespace
}  // namespace regrade
