// Points that photos saw, and how well their distances are known.
#include "reconstruct/scene/point_observations.h"

#include <gtest/gtest.h>

#include "tests/support/pinhole.h"

namespace regrade {
namespace {

Camera CameraAt(double x) {
  Camera camera = testing::PinholeOf(100, 100, 100);
  camera.camera_from_world.rotation = Mat3d{};
  camera.camera_from_world.translation = {-x, 0, 0};
  return camera;
}

// Two cameras one unit apart see a point ten units away: a pixel is 0.01 rad, their rays differ
// by about 0.1 rad, so the distance is known to about 10 * 0.01 / 0.1 = 1.
TEST(PointsSeenBy, UncertaintyIsAPixelOverTheAngleBetweenRays) {
  Capture capture;
  for (const double x : {0.0, 1.0, 2.0}) capture.views.push_back({"", "", "", CameraAt(x)});
  capture.points.push_back({{0.5, 0, 10}, {}, 0, {0, 1}});
  capture.points.push_back({{0.5, 0, 10}, {}, 0, {0, 2}});  // view 2 is not asked for
  Similarity scaled;
  scaled.scale = 0.5;
  scaled.rotation = Mat3d{};
  const auto seen = PointsSeenBy(capture, {0, 1}, scaled);
  ASSERT_EQ(seen.size(), 2u);
  ASSERT_EQ(seen[0].size(), 1u);
  ASSERT_EQ(seen[1].size(), 1u);
  EXPECT_NEAR(seen[0][0].position.z, 5, 1e-6);
  EXPECT_NEAR(seen[0][0].sigma, 0.5, 0.01);  // in the field's unit
}

}  // namespace
}  // namespace regrade
