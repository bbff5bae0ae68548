// Places on Earth in meters.
#include "kernels/scene/geo_position.h"

#include <gtest/gtest.h>

#include <cmath>

namespace regrade {
namespace {

TEST(LocalMeters, AreDistancesOnTheGround) {
  // A minute of latitude is a nautical mile.
  const auto places = LocalMeters({{60, 10, 100}, {60 + 1 / 60.0, 10, 90}, {60, 10.01, 100}});
  EXPECT_NEAR(places[1][1], 1852, 0.003 * 1852);
  EXPECT_NEAR(places[1][0], 0, 1e-9);
  EXPECT_NEAR(places[1][2], -10, 1e-12);
  // WGS 84 at 60 degrees: a hundredth of a degree of longitude is 558.00 m.
  EXPECT_NEAR(places[2][0], 558.0, 0.005 * 558);
}

TEST(LocalMeters, CrossTheDateLine) {
  const auto places = LocalMeters({{0, 179.999, 0}, {0, -179.999, 0}});
  EXPECT_NEAR(places[1][0], 0.002 * 111195, 1);
}

}  // namespace
}  // namespace regrade
