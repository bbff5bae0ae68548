#include "stylize/fit_color_table.h"

#include <gtest/gtest.h>

#include <cmath>

#include "kernels/base/random.h"

namespace regrade {
namespace {

Vec3d RandomColor(uint64_t i) {
  return {RandomDouble(1, 0, i), RandomDouble(1, 1, i), RandomDouble(1, 2, i)};
}

Vec3d Curve(const Vec3d& c) {
  return {std::pow(c.x, 1.5), 0.1 + 0.8 * c.y * c.y, 0.5 * c.z + 0.3 * c.x};
}

TEST(TableFit, ASmoothMapComesBackWhereColoursLie) {
  TableFit fit(17);
  for (uint64_t i = 0; i < 40000; ++i) fit.Add(RandomColor(i), Curve(RandomColor(i)));
  const ColorTable table = fit.Solve();
  for (uint64_t i = 100000; i < 101000; ++i)  // cells are 1/16 wide: curvature leaves 0.003
    ASSERT_LE(Norm(table(RandomColor(i)) - Curve(RandomColor(i))), 0.01);
}

TEST(TableFit, WithoutColoursItGoesOnAsTheLinearMap) {
  const auto linear = [](const Vec3d& c) {
    return Vec3d{0.2 + 0.5 * c.x, 0.1 + 0.6 * c.y + 0.1 * c.x, 0.3 * c.z};
  };
  TableFit fit(9);
  for (uint64_t i = 0; i < 2000; ++i) {  // dark colours alone
    const Vec3d c = RandomColor(i) * 0.3;
    fit.Add(c, linear(c));
  }
  const ColorTable table = fit.Solve();
  for (const Vec3d& c : {Vec3d{1, 1, 1}, Vec3d{0.9, 0.1, 0.5}})
    EXPECT_LE(Norm(table(c) - linear(c)), 1e-5);
  EXPECT_EQ(TableFit(3).Solve().values.size(), 27u);  // of nothing
}

}  // namespace
}  // namespace regrade
