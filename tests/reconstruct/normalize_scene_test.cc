// The scene's box for cameras on a line, at one point, upside down, and in other units
// (H129-H131, H140).
#include "reconstruct/scene/normalize_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"
#include "kernels/scene/facing.h"
#include "tests/support/pinhole.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

Camera LookAt(const Vec3d& center, const Vec3d& target, const Vec3d& up) {
  Camera camera = testing::PinholeOf(640, 480, 600);
  const Vec3d forward = Normalized(target - center);
  const Vec3d right = Normalized(Cross(forward, up));
  camera.camera_from_world = Facing(center, forward, right);
  return camera;
}

Capture ArcCapture(bool points) {
  Capture capture;
  for (int i = 0; i < 9; ++i) {
    const double a = 0.2 * (i - 4);
    capture.views.push_back(
        {"", "", "", LookAt({4 * std::sin(a), -4 * std::cos(a), 1}, {0, 0, 0}, {0, 0, 1})});
  }
  for (uint64_t i = 0; points && i < 400; ++i) {
    ScenePoint p;
    p.position = {2 * RandomDouble(1, 1, i) - 1, 2 * RandomDouble(1, 2, i) - 1,
                  RandomDouble(1, 3, i) - 0.5};
    p.views = {0, 4, 8};
    capture.points.push_back(p);
  }
  return capture;
}

// A valid box has a rotation (H96), finite numbers, half sizes in (0, 1], and a near clip >= 0.
void ExpectValid(const NormalizedScene& scene) {
  EXPECT_NEAR(scene.field_from_world.rotation.Determinant(), 1, 1e-12);
  EXPECT_TRUE(std::isfinite(scene.field_from_world.scale));
  EXPECT_GT(scene.field_from_world.scale, 0);
  float longest = 0;
  for (int a = 0; a < 3; ++a) {
    EXPECT_GT(scene.box.radius[a], 0);
    longest = std::max(longest, scene.box.radius[a]);
  }
  EXPECT_FLOAT_EQ(longest, 1);
  EXPECT_GE(scene.box.near_clip, 0);
}

TEST(NormalizeScene, BoxContainsThePointsUpright) {
  const Capture capture = ArcCapture(true);
  const NormalizedScene scene = NormalizeScene(capture);
  ExpectValid(scene);
  int inside = 0;
  for (const ScenePoint& p : capture.points) {
    const Vec3d q = scene.field_from_world * p.position;
    inside += std::abs(q.x) <= scene.box.radius.x && std::abs(q.y) <= scene.box.radius.y &&
              std::abs(q.z) <= scene.box.radius.z;
  }
  EXPECT_GE(inside, 390);
  // z is up, up to the cameras' tilt.
  EXPECT_GT((scene.field_from_world.rotation * Vec3d{0, 0, 1}).z, 0.9);
}

// A textured object in front of a wall without texture: the points cover a sixth of the
// pictures, and the box contains everything that the photos show at that depth.
TEST(NormalizeScene, BoxContainsRegionsWithoutPoints) {
  Capture capture = ArcCapture(true);
  for (ScenePoint& p : capture.points) p.position = p.position * 0.4;
  const NormalizedScene scene = NormalizeScene(capture);
  ExpectValid(scene);
  int inside = 0;
  for (const CaptureView& view : capture.views)
    for (const double x : {64.0, 320.0, 576.0})
      for (const double y : {48.0, 240.0, 432.0}) {
        const RayT<double> ray = view.camera.WorldRay(x, y);
        const Vec3d q = scene.field_from_world * (ray.origin + ray.direction * 4.0);
        inside += std::abs(q.x) <= scene.box.radius.x && std::abs(q.y) <= scene.box.radius.y &&
                  std::abs(q.z) <= scene.box.radius.z;
      }
  EXPECT_GE(inside, 73);  // of 81
}

// A given box decides, with and without points, however the cameras are turned.
TEST(NormalizeScene, AGivenBoxIsTheBox) {
  for (const bool points : {false, true}) {
    Capture capture = ArcCapture(points);
    capture.box = WorldBox{{-1, -0.5, 0}, {2, 0.5, 1}};
    const NormalizedScene scene = NormalizeScene(capture);
    ExpectValid(scene);
    EXPECT_TRUE(scene.notice.empty());
    // The cameras look along y and are upright, so the frame's axes are the world's; 3 is the
    // longest side, widened by 8 % on each.
    EXPECT_NEAR(scene.field_from_world.scale, 1 / (3 * 0.58), 0.01);
    EXPECT_NEAR(scene.box.radius.y / scene.box.radius.x, 1.0 / 3, 0.1);
    const Vec3d middle = scene.field_from_world * Vec3d{0.5, 0, 0.5};
    EXPECT_NEAR(Norm(middle), 0, 1e-9);
    EXPECT_GT(scene.box.near_clip, 0);
  }
  // Cameras inside have nothing to clip.
  Capture inside = ArcCapture(false);
  inside.box = WorldBox{{-9, -9, -9}, {9, 9, 9}};
  EXPECT_EQ(NormalizeScene(inside).box.near_clip, 0);
}

TEST(NormalizeScene, H140_OtherUnitsGiveTheSameField) {
  const Capture capture = ArcCapture(true);
  const NormalizedScene scene = NormalizeScene(capture);
  for (const double scale : {1e-6, 1e6}) {
    Capture scaled = capture;
    const Vec3d shift{3 * scale, -7 * scale, 0.5 * scale};
    for (ScenePoint& p : scaled.points) p.position = p.position * scale + shift;
    for (CaptureView& view : scaled.views)
      view.camera = view.camera.Transformed({scale, Mat3d(), shift});
    const NormalizedScene other = NormalizeScene(scaled);
    EXPECT_NEAR(other.box.near_clip, scene.box.near_clip, 1e-5);
    for (size_t i = 0; i < capture.views.size(); ++i) {
      const Vec3d a = capture.views[i].camera.Transformed(scene.field_from_world).Center();
      const Vec3d b = scaled.views[i].camera.Transformed(other.field_from_world).Center();
      EXPECT_NEAR(Norm(a - b), 0,
                  testing::RecordBound("a camera in units of 1e-6 and 1e6",
                                       testing::Computed::kDouble, Norm(a - b), 1e-6));
    }
  }
}

TEST(NormalizeScene, H154_OrderOfPhotosDoesNotMatter) {
  const Capture capture = ArcCapture(true);
  Capture reversed = capture;
  std::reverse(reversed.views.begin(), reversed.views.end());
  for (ScenePoint& p : reversed.points)
    for (int32_t& v : p.views) v = 8 - v;
  std::reverse(reversed.points.begin(), reversed.points.end());
  const NormalizedScene a = NormalizeScene(capture), b = NormalizeScene(reversed);
  EXPECT_TRUE(testing::RecordSameBits("scale of reversed photos", testing::Computed::kDouble,
                                      a.field_from_world.scale == b.field_from_world.scale));
  EXPECT_EQ(a.field_from_world.translation, b.field_from_world.translation);
  EXPECT_EQ(a.box.near_clip, b.box.near_clip);
}

TEST(NormalizeScene, H129_CollinearCameras) {
  Capture capture;
  const Vec3d up{0, -0.6, 0.8};  // not a coordinate axis
  for (int i = 0; i < 6; ++i)
    capture.views.push_back({"", "", "", LookAt({0.3 * i, 0, 0}, {0.3 * i, 4, 3}, up)});
  const NormalizedScene scene = NormalizeScene(capture);
  ExpectValid(scene);
  const double upright = (scene.field_from_world.rotation * up).z;
  EXPECT_NEAR(upright, 1,
              testing::RecordDigits("up", testing::Computed::kDouble, upright - 1, 1e-12));
}

TEST(NormalizeScene, H130_CamerasAtOnePoint) {
  Capture capture;
  for (int i = 0; i < 4; ++i)
    capture.views.push_back(
        {"", "", "", LookAt({1, 2, 3}, {1 + std::cos(i), 2 + std::sin(i), 3}, {0, 0, 1})});
  // Rounding errors are not used as the unit; without another one the box is a cube of
  // radius 1.
  const auto expect_scale = [&](double scale) {
    const NormalizedScene scene = NormalizeScene(capture);
    ExpectValid(scene);
    EXPECT_NEAR(scene.field_from_world.scale, scale, 0.2 * scale);  // 8 % margin
    EXPECT_NE(scene.notice.find("one place"), std::string::npos) << scene.notice;
  };
  expect_scale(1);
  ScenePoint far;
  far.position = {1, 52, 3};
  capture.points = {far};
  expect_scale(1 / 50.0);
  capture.points.clear();
  capture.views.resize(1);
  expect_scale(1);
}

TEST(NormalizeScene, H131_UpsThatCancel) {
  Capture capture;
  for (int i = 0; i < 8; ++i)
    capture.views.push_back(
        {"", "", "",
         LookAt({3 * std::cos(i), 3 * std::sin(i), 0}, {0, 0, 0}, {0, 0, i % 2 ? 1.0 : -1.0})});
  const NormalizedScene scene = NormalizeScene(capture);
  ExpectValid(scene);
  // The cameras' circle is horizontal; which side is up is a convention.
  const double level = scene.field_from_world.rotation.row[2].z;
  EXPECT_NEAR(level, 1,
              testing::RecordDigits("the circle's normal", testing::Computed::kDouble,
                                    level - 1, 1e-12));
  EXPECT_NE(scene.notice.find("disagree about up"), std::string::npos) << scene.notice;
}

}  // namespace
}  // namespace regrade
