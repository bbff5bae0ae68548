// Splats that are fitted to voxels, and the views that this is done on.
#include "pipeline/stages/splats_of_voxels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "kernels/image/decibels.h"
#include "kernels/render/field_renderer.h"
#include "tests/support/pinhole.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

// On a ring, looking at the origin.
Camera OnRing(double angle, double radius) {
  const Vec3d center{radius * std::cos(angle), radius * std::sin(angle), 0.5};
  Camera camera = testing::PinholeOf(64, 48, 60);
  Mat3d& rotation = camera.camera_from_world.rotation;
  rotation.row[2] = Normalized(-center);
  rotation.row[0] = Normalized(Cross(rotation.row[2], Vec3d{0, 0, 1}));
  rotation.row[1] = Cross(rotation.row[2], rotation.row[0]);
  camera.camera_from_world.translation = -(rotation * center);
  return camera;
}

Capture Ring(int count) {
  Capture capture;
  for (int i = 0; i < count; ++i) {
    CaptureView view;
    view.name = view.file = std::to_string(i) + ".png";
    view.camera = OnRing(2 * M_PI * i / count, 3);
    capture.views.push_back(view);
  }
  return capture;
}

// A coloured ball of voxels, of which `shift` changes the colours.
StoredField Ball(float shift) {
  const auto color = [&](const Vec3f& p, int c) {
    return 0.8f * std::sin(3.0f * p[c] + static_cast<float>(c) + shift);
  };
  return {testing::VoxelBall(0.7f, 200, color), {}, {}};
}

double DbOnNewViews(const SplatsOfVoxels& fit, const StoredField& voxels,
                    const StoredField& splats) {
  const FieldRenderer of_voxels(voxels.field, Backend::kCpu),
      of_splats(splats.field, Backend::kCpu);
  const std::vector<Camera> views = fit.MeasuredViews(voxels);
  double worst = 1e9;
  for (size_t i = 0; i < views.size(); ++i)
    worst =
        std::min(worst, DecibelsBetween(of_splats.Render(fit.MeasuredViews(splats)[i]).color,
                                        of_voxels.Render(views[i]).color));
  return worst;
}

// The worst view has 40.4 dB; 28.2 dB of the style after few steps, 19.2 dB without any.
TEST(SplatsOfVoxels, LookAsTheVoxelsDoOnNewViewsAndStylesKeepTheirGeometry) {
  RunSettings settings;
  settings.scene.photo_size = 64;
  settings.run.effects = "exposure=off";
  SplatsOfVoxels fit(Ring(12), settings,
                     {.thousands = 1.5f, .renders = 16, .steps = 120, .color_steps = 80},
                     Backend::kCpu);
  const StoredField scene = Ball(0), style = Ball(1.5f);
  const StoredField splats = fit.Fit(scene, {});
  EXPECT_GE(DbOnNewViews(fit, scene, splats), 36);
  EXPECT_LE(DbOnNewViews(fit, style, splats), 21);
  const StoredField styled = fit.Recolor(style, {});
  EXPECT_GE(DbOnNewViews(fit, style, styled), 26);
  const SplatGeometry &before = splats.field.geometry->splats,
                      &after = styled.field.geometry->splats;
  ASSERT_EQ(after.mean.size(), before.mean.size());
  for (int64_t i = 0; i < before.mean.size(); ++i)
    EXPECT_NEAR(after.mean[i], before.mean[i], 1e-6f);
  for (int64_t i = 0; i < before.log_scale.size(); ++i)
    ASSERT_EQ(after.log_scale[i], before.log_scale[i]);
  for (int64_t i = 0; i < before.opacity_logit.size(); ++i)
    ASSERT_EQ(after.opacity_logit[i], before.opacity_logit[i]);
}

TEST(ViewsNear, AreThePhotosAndOthersNearThemAndTheMeasuredOnesAreNoneOfThese) {
  std::vector<Camera> cameras;
  for (const CaptureView& view : Ring(12).views) cameras.push_back(view.camera);
  const NearbyViews views = ViewsNear(cameras, 40);
  ASSERT_EQ(views.fitted.size(), 40u);
  ASSERT_EQ(views.measured.size(), static_cast<size_t>(kMeasuredNearby));
  const double gap = Norm(cameras[1].Center() - cameras[0].Center());
  const auto nearest = [](const Camera& view, const std::vector<Camera>& others) {
    double least = 1e9;
    for (const Camera& other : others)
      least = std::min(least, Norm(other.Center() - view.Center()));
    return least;
  };
  for (const Camera& camera : cameras) EXPECT_EQ(nearest(camera, views.fitted), 0);
  for (const Camera& view : views.fitted) EXPECT_LE(nearest(view, cameras), 0.9 * gap);
  for (const Camera& view : views.measured) {
    EXPECT_LE(nearest(view, cameras), 0.9 * gap);
    EXPECT_GT(nearest(view, views.fitted), 0.02 * gap);
    EXPECT_GT(Dot(view.Forward(), Normalized(-view.Center())), 0.9);
  }
}

// Two groups of photos, back to back: nothing is looked at from between them.
TEST(ViewsNear, LeaveGapsOfTheTourAlone) {
  std::vector<Camera> cameras;
  for (const double middle : {0.0, M_PI})
    for (int i = 0; i < 4; ++i) cameras.push_back(OnRing(middle + 0.1 * i, 3));
  for (const Camera& view : ViewsNear(cameras, 40).fitted) EXPECT_GT(Norm(view.Center()), 2.5);
  EXPECT_EQ(ViewsNear({cameras[0]}, 8).fitted.size(), 8u);
}

}  // namespace
}  // namespace regrade
