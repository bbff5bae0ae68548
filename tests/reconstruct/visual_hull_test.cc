// The box of an object on a transparent background has the object's size, wherever the cameras
// are.
#include "reconstruct/scene/visual_hull.h"

#include <gtest/gtest.h>

#include <cmath>

#include "kernels/scene/facing.h"

namespace regrade {
namespace {

// A ball of radius 0.5 around (1, 0, 0), seen from a circle; it nearly fills the pictures.
// Silhouettes of cameras below `empty_angle` are empty.
std::vector<Silhouette> BallSilhouettes(double empty_angle) {
  std::vector<Silhouette> silhouettes;
  for (int i = 0; i < 12; ++i) {
    const double angle = 2 * M_PI * i / 12;
    const Vec3d ball{1, 0, 0};
    const Vec3d center = ball + Vec3d{4 * std::cos(angle), 4 * std::sin(angle), i % 3 - 1.0};
    Silhouette silhouette;
    Camera& camera = silhouette.camera;
    camera.width = camera.height = 200;
    camera.fx = camera.fy = 500;
    camera.cx = camera.cy = 100;
    const Vec3d forward = Normalized(ball - center);
    const Vec3d right = Normalized(Cross(forward, Vec3d{0, 0, 1}));
    camera.camera_from_world = Facing(center, forward, right);
    silhouette.alpha = Image(200, 200, 1);
    for (int y = 0; y < 200; ++y)
      for (int x = 0; x < 200; ++x) {
        const RayT<double> ray = camera.WorldRay(x + 0.5, y + 0.5);
        const Vec3d off = Cross(ball - ray.origin, ray.direction);
        *silhouette.alpha.at(x, y) = Norm(off) < 0.5 && angle >= empty_angle ? 1.0f : 0.0f;
      }
    silhouettes.push_back(std::move(silhouette));
  }
  return silhouettes;
}

NormalizedScene CubeAroundTheCameras() {
  NormalizedScene scene;
  // Half side 6 around the ball.
  scene.field_from_world = {1 / 6.0, Mat3d(), Vec3d{-1 / 6.0, 0, 0}};
  scene.box.radius = {1, 1, 1};
  scene.box.near_clip = 0.1f;
  return scene;
}

TEST(VisualHull, BoxFitsTheObject) {
  const NormalizedScene tight =
      TightenToSilhouettes(CubeAroundTheCameras(), BallSilhouettes(0));
  const double half = 1 / tight.field_from_world.scale;  // world units
  EXPECT_GE(half, 0.5);
  // Enlarged by up to two blocks of pixels (0.13), and by one vertex of the grid (0.126) plus
  // its rounding.
  EXPECT_LE(half, 0.5 + 0.13 + 2 * 12.0 / 95);
  const Vec3d middle = tight.field_from_world * Vec3d{1, 0, 0};
  EXPECT_NEAR(Norm(middle), 0, 0.2);
  // The same length in world units.
  EXPECT_NEAR(tight.box.near_clip / tight.field_from_world.scale, 0.6, 1e-5);
}

TEST(VisualHull, InconsistentSilhouettesDoNotChangeTheBox) {
  const NormalizedScene scene = CubeAroundTheCameras();
  const NormalizedScene same = TightenToSilhouettes(scene, BallSilhouettes(4));
  EXPECT_EQ(same.field_from_world.scale, scene.field_from_world.scale);
}

}  // namespace
}  // namespace regrade
