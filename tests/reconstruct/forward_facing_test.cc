// Forward-facing captures: their detection, and that their NDC box contains every pixel's ray
// (H87-H90).
#include "reconstruct/scene/forward_facing.h"

#include <gtest/gtest.h>

#include <cmath>

#include "kernels/base/random.h"
#include "tests/support/expect_error.h"
#include "tests/support/pinhole.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

// Cameras on a wall that look along +y, z up; the scene has depths from 3 to 40.
Capture WallCapture(double turn_deg, double forward_step) {
  Capture capture;
  for (int i = 0; i < 9; ++i) {
    Camera camera = testing::PinholeOf(400, 300, 350);
    const double angle = turn_deg * M_PI / 180 * (i - 4) / 4;
    const Vec3d forward{std::sin(angle), std::cos(angle), 0},
        right{std::cos(angle), -std::sin(angle), 0};
    camera.camera_from_world.rotation.row[0] = right;
    camera.camera_from_world.rotation.row[1] = Vec3d{0, 0, -1};
    camera.camera_from_world.rotation.row[2] = forward;
    const Vec3d center{0.3 * (i % 3), forward_step * (i / 3), 0.2 * (i / 3)};
    camera.camera_from_world.translation = -(camera.camera_from_world.rotation * center);
    capture.views.push_back({"", "photo" + std::to_string(i), "", camera});
  }
  for (uint64_t i = 0; i < 300; ++i) {
    ScenePoint point;
    const double depth = 3 / (1 - 0.92 * RandomDouble(5, 1, i));
    point.position = {depth * (RandomDouble(5, 2, i) - 0.5), depth,
                      depth * 0.5 * (RandomDouble(5, 3, i) - 0.5)};
    point.views = {0, 4, 8};
    capture.points.push_back(point);
  }
  return capture;
}

TEST(ForwardFacing, H87_IsDistinguishedFromTurningCaptures) {
  EXPECT_TRUE(MeasureForwardFacing(WallCapture(10, 0.05)).on);
  EXPECT_FALSE(MeasureForwardFacing(WallCapture(40, 0.05)).on);
  EXPECT_FALSE(MeasureForwardFacing(WallCapture(10, 1)).on);  // moves into the scene
  Capture two = WallCapture(0, 0);
  two.views.resize(2);
  two.points.clear();
  EXPECT_FALSE(MeasureForwardFacing(two).on);
}

// A depth given with the poses is not replaced by an estimate from points.
TEST(ForwardFacing, AGivenDepthIsUsed) {
  Capture capture = WallCapture(10, 0.05);
  EXPECT_NE(MeasureForwardFacing(capture).nearest, 2.5);
  capture.nearest_depth = 2.5;
  EXPECT_EQ(MeasureForwardFacing(capture).nearest, 2.5);
}

// A margin replaces the reach of all photos: 250 of 1008 pixels, as published, on both sides.
TEST(ForwardFacing, AMarginAroundTheMeanPictureIsTheRadius) {
  const Capture capture = WallCapture(10, 0.05);  // 400 x 300 pixels
  const NormalizedScene scene =
      NormalizeForwardFacing(capture, MeasureForwardFacing(capture), 0.25);
  EXPECT_FLOAT_EQ(scene.box.radius.x, 1 + 2 * 100.0f / 400);
  EXPECT_FLOAT_EQ(scene.box.radius.y, 1 + 2 * 100.0f / 300);
  EXPECT_EQ(scene.box.radius.z, 1.0f);
}

TEST(ForwardFacing, H88_EveryRayStaysInTheBoxAndMeetsTheScene) {
  const Capture capture = WallCapture(10, 0.05);
  const NormalizedScene scene = NormalizeForwardFacing(capture, MeasureForwardFacing(capture));
  ASSERT_TRUE(scene.ndc.on());
  for (const CaptureView& view : capture.views) {
    Camera camera = view.camera.Transformed(scene.field_from_world);
    camera.ndc = scene.ndc;
    for (const int x : {0, 200, 399})
      for (const int y : {0, 150, 299}) {
        const Ray ray = camera.PixelRay(x, y);
        EXPECT_NEAR(Norm(ray.direction), 1, 1e-6);
        EXPECT_EQ(ray.origin.z, -1.0f);
        for (const float fraction : {0.0f, 0.5f, 1.0f}) {
          const Vec3f p = ray.origin + ray.direction * (fraction * 2 / ray.direction.z);
          EXPECT_LE(std::abs(p.x), scene.box.radius.x * 1.0001f);
          EXPECT_LE(std::abs(p.y), scene.box.radius.y * 1.0001f);
        }
        // A point of the pixel's ray in the world has the ray's NDC.
        const RayT<double> world = camera.WorldRay(x + 0.5, y + 0.5);
        const Vec3d at = world.origin + world.direction * 5.0;
        const Vec3d ndc{scene.ndc.a * at.x / at.z, scene.ndc.b * at.y / at.z, 1 - 2 / at.z};
        const Vec3d off = Cross(ndc - ray.origin.Cast<double>(), ray.direction.Cast<double>());
        EXPECT_NEAR(Norm(off), 0,
                    testing::RecordBound("a ray from its point", testing::Computed::kFloat,
                                         Norm(off), 1e-6));
        EXPECT_NEAR(Norm(WorldFromNdc(scene.ndc, ndc) - at), 0,
                    testing::RecordBound("there and back", testing::Computed::kDouble,
                                         Norm(WorldFromNdc(scene.ndc, ndc) - at), 1e-9));
      }
  }
  for (const ScenePoint& point : capture.points)
    EXPECT_GT((scene.field_from_world * point.position).z, 1);  // behind the near plane
}

// NDC does not depend on which photo is first.
TEST(ForwardFacing, H159_PhotosOfTwoShapesInAnyOrder) {
  Capture capture = WallCapture(10, 0.05);
  for (const size_t i : {0, 5}) {
    Camera& upright = capture.views[i].camera;
    std::swap(upright.width, upright.height);
    std::swap(upright.cx, upright.cy);
  }
  const NormalizedScene scene = NormalizeForwardFacing(capture, MeasureForwardFacing(capture));
  EXPECT_DOUBLE_EQ(scene.ndc.a, 2 * 350.0 / 400);
  EXPECT_DOUBLE_EQ(scene.ndc.b, 2 * 350.0 / 300);
  // Half of a portrait photo's height, 200 px, is 4 / 3 of the common camera's.
  EXPECT_GT(scene.box.radius.y, 4.0 / 3);
  std::swap(capture.views[0], capture.views[1]);
  const NormalizedScene other = NormalizeForwardFacing(capture, MeasureForwardFacing(capture));
  EXPECT_EQ(other.ndc.a, scene.ndc.a);
  EXPECT_EQ(other.box.voxel_aspect, scene.box.voxel_aspect);
}

TEST(ForwardFacing, H89_ACameraThatLooksBackIsNamed) {
  Capture capture = WallCapture(10, 0.05);
  Camera& backward = capture.views[5].camera;
  const Vec3d center = backward.Center();
  for (const int axis : {0, 2})
    backward.camera_from_world.rotation.row[axis] =
        -backward.camera_from_world.rotation.row[axis];
  backward.camera_from_world.translation = -(backward.camera_from_world.rotation * center);
  ForwardFacing measured = MeasureForwardFacing(WallCapture(10, 0.05));
  EXPECT_REGRADE_ERROR(NormalizeForwardFacing(capture, measured), ExitCode::kScene, "photo5: ");
}

TEST(ForwardFacing, H90_ARayThatDoesNotRunForwardMissesTheField) {
  const NdcSpace space{1.5, 2};
  Vec3f origin{0, 0, 0}, direction = Normalized(Vec3f{1, 0, -0.1f});
  NdcRay(space, &origin, &direction);
  EXPECT_EQ(Norm(direction), 0.0f);
}

TEST(ForwardFacing, H90_InfinitelyFarIsTheFarFace) {
  const NdcSpace space{1.5, 2};
  Vec3d origin{0.3, -0.2, 0}, direction = Normalized(Vec3d{0.1, 0.2, 1});
  const Vec3d towards = direction, from = origin;
  NdcRay(space, &origin, &direction);
  const Vec3d far = origin + direction * (2 / direction.z);  // z = 1
  EXPECT_NEAR(far.z, 1, 1e-12);
  // A point at a depth of 1e12 is there up to 2e-12, and all coordinates are finite.
  const Vec3d p = from + towards * (1e12 / towards.z);
  EXPECT_NEAR(far.x, space.a * p.x / p.z,
              testing::RecordBound("a point at a depth of 1e12", testing::Computed::kDouble,
                                   far.x - space.a * p.x / p.z, 1e-9));
  EXPECT_NEAR(far.y, space.b * p.y / p.z, 1e-9);
  EXPECT_TRUE(std::isfinite(WorldFromNdc(space, Vec3d{0, 0, 1 - 2e-12}).z));
}

}  // namespace
}  // namespace regrade
