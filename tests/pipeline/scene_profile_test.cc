#include "pipeline/capture/scene_profile.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/scene/facing.h"
#include "pipeline/capture/working_views.h"
#include "tests/support/expect_error.h"
#include "tests/support/pinhole.h"

namespace regrade {
namespace {

// k1 moves the corner at r = 1.25 (fx = 400 of 800 x 600) by k1 r^3 400 pixels.
Camera CameraWithShift(double pixels) {
  Camera camera = testing::PinholeOf(800, 600, 400);
  camera.lens = LensModel::kOpenCv;
  camera.distortion[0] = pixels / (400 * 1.25 * 1.25 * 1.25);
  return camera;
}

Capture CaptureWithShifts(const std::vector<double>& shifts) {
  Capture capture;
  for (const double shift : shifts) {
    CaptureView view;
    view.camera = CameraWithShift(shift);
    capture.views.push_back(view);
  }
  return capture;
}

TEST(SceneEffects, LensBelowThresholdIsAPinhole) {
  const Camera weak = WorkingCamera(CameraWithShift(0.49), 800, {}, {});
  EXPECT_EQ(weak.lens, LensModel::kPinhole);
  EXPECT_EQ(weak.MaxCornerDistortion(), 0);
  // Rays are, bit for bit, those of a camera without a lens model.
  const Ray ray = weak.PixelRay(799, 0),
            plain = CameraWithShift(0.49).Undistorted().PixelRay(799, 0);
  EXPECT_EQ(ray.direction, plain.direction);
}

TEST(SceneEffects, LensAboveThresholdStays) {
  const Camera strong = WorkingCamera(CameraWithShift(0.51), 800, {}, {});
  EXPECT_EQ(strong.lens, LensModel::kOpenCv);
  EXPECT_NEAR(strong.MaxCornerDistortion(), 0.51, 1e-9);
  // It is judged on the photo, not on the smaller picture that is worked with.
  EXPECT_EQ(WorkingCamera(CameraWithShift(0.51), 100, {}, {}).lens, LensModel::kOpenCv);
}

TEST(SceneEffects, H153_RowsCarryTheNumbersOfTheDecision) {
  const auto rows = ProfileScene(CaptureWithShifts({0.1, -12.3, 3}), 2, "auto").effects;
  ASSERT_EQ(rows.size(), 6u);
  EXPECT_EQ(rows[0].name, "distortion");
  EXPECT_TRUE(rows[0].on);
  EXPECT_NEAR(*rows[0].value.value, 12.3, 1e-9);
  EXPECT_EQ(*rows[0].threshold.value, 0.5);
  EXPECT_EQ(EffectLine(rows[0]).substr(0, 25), "distortion on: 12.3 > 0.5");
  EXPECT_EQ(rows[4].name, "view-dependence");
  EXPECT_TRUE(rows[4].on);
  EXPECT_EQ(*rows[4].value.value, 2);

  const auto off = ProfileScene(CaptureWithShifts({0.1, 0.3}), 0, "auto").effects;
  EXPECT_FALSE(off[0].on);
  EXPECT_FALSE(off[4].on);
  EXPECT_EQ(EffectLine(off[0]).substr(0, 26), "distortion off: 0.3 <= 0.5");
}

TEST(SceneProfile, OverridesAreParsedAndErrorsNamed) {
  EXPECT_TRUE(ParseEffects("auto").empty());
  const auto overrides = ParseEffects("ndc=off,alpha=on");
  EXPECT_FALSE(overrides.at("ndc"));
  EXPECT_TRUE(overrides.at("alpha"));
  for (const char* text : {"fog", "ndc", "ndc=maybe", "distortion=on", ","})
    EXPECT_REGRADE_ERROR(ParseEffects(text), ExitCode::kUsage, "is not allowed");
}

// Cameras side by side that look one way: NDC by itself, the box when an override asks for it.
TEST(SceneProfile, ForwardFacingCapturesUseNdc) {
  Capture capture = CaptureWithShifts({0, 0, 0, 0});
  for (size_t i = 0; i < capture.views.size(); ++i)
    capture.views[i].camera.camera_from_world.translation = {0.1 * static_cast<double>(i), 0,
                                                             0};
  capture.nearest_depth = 2;
  EXPECT_TRUE(ProfileScene(capture, 2, "auto").scene.ndc.on());
  EXPECT_FALSE(ProfileScene(capture, 2, "ndc=off").scene.ndc.on());
  const auto rows = ProfileScene(capture, 2, "auto").effects;
  EXPECT_EQ(rows[1].name, "ndc");
  EXPECT_TRUE(rows[1].on);
}

// Eight cameras round a table of points, and `far` points per camera fifty times as far out.
Capture CaptureSeenAllRound(int far) {
  Capture capture;
  for (int i = 0; i < 8; ++i) {
    const double a = 2 * M_PI * i / 8;
    CaptureView view;
    view.camera = CameraWithShift(0);
    const Vec3d center{2 * std::cos(a), 2 * std::sin(a), 0.3};
    const Vec3d forward = Normalized(-center),
                right = Normalized(Cross(forward, Vec3d{0, 0, 1}));
    RigidTransform& t = view.camera.camera_from_world;
    t = Facing(center, forward, right);
    capture.views.push_back(view);
    const auto add = [&](const Vec3d& position) {
      ScenePoint point;
      point.position = position;
      point.views = {i, (i + 1) % 8};
      capture.points.push_back(point);
    };
    for (int k = 0; k < 20; ++k) add({0.3 * std::sin(k + a), 0.3 * std::cos(2 * k), 0.02 * k});
    for (int k = 0; k < far; ++k) add(forward * 100.0 + right * (3.0 * k));
  }
  return capture;
}

// H153, H156: layers where much is far all round, measured, and no trace of them elsewhere.
TEST(SceneProfile, H153_H156_FarSurroundingsUseSpheres) {
  const SceneProfile near = ProfileScene(CaptureSeenAllRound(0), 2, "exposure=off");
  EXPECT_FALSE(near.scene.box.far_surroundings);
  EXPECT_EQ(near.effects[3].name, "background");
  EXPECT_EQ(*near.effects[3].value.value, 0);
  const SceneProfile far = ProfileScene(CaptureSeenAllRound(5), 2, "exposure=off");
  EXPECT_TRUE(far.scene.box.far_surroundings);
  EXPECT_NEAR(*far.effects[3].value.value, 0.2, 1e-12);  // 5 of 25
  // The box is the cube that reaches the cameras, upright along y: 2.02 m are 0.9 of its half.
  EXPECT_EQ(far.scene.box.radius, (Vec3f{1, 1, 1}));
  EXPECT_NEAR(far.scene.field_from_world.scale, 0.9 / std::hypot(2.0, 0.3), 1e-3);
  EXPECT_NEAR(far.scene.field_from_world.rotation(1, 2), 1, 1e-9);
  // An override decides; contradictions are named.
  EXPECT_FALSE(ProfileScene(CaptureSeenAllRound(5), 2, "background=off,exposure=off")
                   .scene.box.far_surroundings);
  EXPECT_TRUE(ProfileScene(CaptureSeenAllRound(0), 2, "background=on,exposure=off")
                  .scene.box.far_surroundings);
  EXPECT_REGRADE_ERROR(
      ProfileScene(CaptureSeenAllRound(5), 2, "background=on,alpha=on,exposure=off"),
      ExitCode::kUsage, "alpha");
}

TEST(SceneProfile, FarSurroundingsOfSplatsLeaveTheBoxAsItIs) {
  const SceneProfile near =
      ProfileScene(CaptureSeenAllRound(0), 2, "exposure=off", {}, KindNamed("splats"));
  EXPECT_FALSE(near.scene.box.far_surroundings);
  const SceneProfile far =
      ProfileScene(CaptureSeenAllRound(5), 2, "exposure=off", {}, KindNamed("splats"));
  EXPECT_TRUE(far.scene.box.far_surroundings);
  EXPECT_EQ(far.effects[3].on, true);
  const SceneProfile without = ProfileScene(
      CaptureSeenAllRound(5), 2, "background=off,exposure=off", {}, KindNamed("splats"));
  EXPECT_FALSE(without.scene.box.far_surroundings);
  EXPECT_EQ(without.scene.box.radius, far.scene.box.radius);
  EXPECT_EQ(without.scene.field_from_world.scale, far.scene.field_from_world.scale);
}

// What is given is not measured.
TEST(SceneProfile, OptionsOfTheBoxReplaceMeasurements) {
  BoxOptions box{.camera_range = 2, .near_clip = 0, .background = 0.5f};
  for (const char* background : {"background=off", "background=on"}) {
    const SceneProfile given =
        ProfileScene(CaptureSeenAllRound(5), 2, std::string(background) + ",exposure=off", box);
    EXPECT_EQ(given.scene.box.radius, (Vec3f{1, 1, 1}));
    EXPECT_NEAR(given.scene.field_from_world.scale, 2 / std::hypot(2.0, 0.3), 1e-3);
    EXPECT_EQ(given.scene.box.near_clip, 0.0f);
    EXPECT_EQ(given.scene.box.background.value(), (Vec3f{0.5f, 0.5f, 0.5f}));
    EXPECT_EQ(given.scene.box.far_surroundings, std::string(background) == "background=on");
  }
}

// H154: the photos' order does not matter.
TEST(SceneProfile, H154_BackgroundIsIndependentOfThePhotosOrder) {
  Capture capture = CaptureSeenAllRound(2);
  const double value = *ProfileScene(capture, 2, "exposure=off").effects[3].value.value;
  std::reverse(capture.points.begin(), capture.points.end());
  EXPECT_EQ(*ProfileScene(capture, 2, "exposure=off").effects[3].value.value, value);
}

}  // namespace
}  // namespace regrade
