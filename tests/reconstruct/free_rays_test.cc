// Points that photos saw, and the rays that are free up to them.
#include "reconstruct/fit/free_rays.h"

#include <gtest/gtest.h>

#include <cmath>

namespace regrade {
namespace {

Camera CameraAt(double x) {
  Camera camera;
  camera.width = camera.height = 100;
  camera.fx = camera.fy = 100;
  camera.cx = camera.cy = 50;
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

TEST(FreeRays, H168_EndBeforeThePointLessItsUncertaintyAndTheMargin) {
  const std::vector<TrainingView> views = {
      {CameraAt(0), nullptr, {{{1, 0.5f, 4}, 0.25f}, {{0, 0, -3}, 0.1f}}}};
  const std::vector<FreeRay> rays = FreeRays(views, 0.5, 1);
  ASSERT_EQ(rays.size(), 1u);  // the other point is behind the camera
  const double distance = std::sqrt(1 + 0.25 + 16);
  EXPECT_NEAR(rays[0].length, distance - 0.75, 1e-5);
  EXPECT_NEAR(rays[0].ray.direction.x, 1 / distance, 1e-6);
}

// Beside points at distances of 4 to 11, free up to four fifths of the nearest.
TEST(FreeRays, RandomPixelsAreFreeUpToPartOfTheNearestPointBeside) {
  std::vector<TrainingView> views = {{CameraAt(0), nullptr, {}}};
  for (int i = 0; i < 8; ++i)
    views[0].points.push_back({{0, 0, 4.0f + static_cast<float>(i)}, 0.1f});
  const std::vector<FreeRay> rays = FreeRays(views, 0, 1);
  ASSERT_EQ(rays.size(), 16u);
  for (size_t i = 8; i < 16; ++i) EXPECT_NEAR(rays[i].length, 3.2, 1e-5);
  views[0].points.pop_back();  // too few points to say anything about other pixels
  EXPECT_EQ(FreeRays(views, 0, 1).size(), 7u);
}

TEST(FreeRays, H168_InDeviceCoordinatesTheLengthIsOfThatSpace) {
  TrainingView view{CameraAt(0), nullptr, {{{1, 0.5f, 4}, 0}, {{0.1f, 0, 0.5f}, 0}}};
  view.camera.ndc = {2, 2};
  const std::vector<FreeRay> rays = FreeRays({view}, 0, 1);
  ASSERT_EQ(rays.size(), 1u);  // the other point is before the near plane
  // Before this camera, and behind the one of the device coordinates.
  TrainingView behind{view.camera, nullptr, {{{0, 0, -0.5f}, 0}}};
  behind.camera.camera_from_world.translation = {0, 0, 1};
  EXPECT_TRUE(FreeRays({behind}, 0, 1).empty());
  const Vec3d end = rays[0].ray.origin.Cast<double>() +
                    rays[0].ray.direction.Cast<double>() * double{rays[0].length};
  const Vec3d world = WorldFromNdc(view.camera.ndc, end);
  EXPECT_NEAR(world.x, 1, 1e-5);
  EXPECT_NEAR(world.y, 0.5, 1e-5);
  EXPECT_NEAR(world.z, 4, 1e-5);
}

}  // namespace
}  // namespace regrade
