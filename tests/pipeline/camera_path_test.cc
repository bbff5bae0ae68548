// Paths of the film's camera: smooth, within the photos' hull, looking where they look.
#include "pipeline/fields/camera_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

std::vector<Camera> Arc(int n, bool shuffled) {
  std::vector<Camera> cameras(static_cast<size_t>(n));
  for (int i = 0; i < n; ++i) {
    const int k = shuffled ? (i * 7) % n : i;
    const double a = 1.6 * (static_cast<double>(k) / (n - 1) - 0.5);
    const Vec3d center{3 * std::sin(a), -3 * std::cos(a), 0.5};
    const Vec3d forward = Normalized(Vec3d{0, 0, 0} - center);
    const Vec3d right = Normalized(Cross(forward, Vec3d{0, 0, 1}));
    Camera& c = cameras[static_cast<size_t>(i)];
    c.width = 64;
    c.height = 48;
    c.fx = c.fy = 60;
    c.cx = 30;
    c.cy = 25;
    c.camera_from_world.rotation.row[0] = right;
    c.camera_from_world.rotation.row[1] = Cross(forward, right);
    c.camera_from_world.rotation.row[2] = forward;
    c.camera_from_world.translation = -(c.camera_from_world.rotation * center);
  }
  return cameras;
}

void ExpectCameras(const std::vector<Camera>& path) {
  for (const Camera& camera : path) {
    EXPECT_NEAR(camera.camera_from_world.rotation.Determinant(), 1, 1e-9);
    EXPECT_TRUE(AllFinite(camera.Center()));
    EXPECT_EQ(camera.cx, 32);
    EXPECT_EQ(camera.lens, LensModel::kPinhole);
  }
}

TEST(CameraPath, SmoothHasNoJumpsEvenFromShuffledPhotos) {
  for (const bool shuffled : {false, true}) {
    const std::vector<Camera> path = MakeCameraPath(Arc(15, shuffled), {"smooth", 60});
    ASSERT_EQ(path.size(), 60u);
    ExpectCameras(path);
    double largest = 0, total = 0;
    for (size_t i = 1; i < path.size(); ++i) {
      const double step = Norm(path[i].Center() - path[i - 1].Center());
      largest = std::max(largest, step);
      total += step;
    }
    EXPECT_LT(largest, 4 * total / 59) << shuffled;
    EXPECT_GT(total, 2.5) << "the flight covers the arc of 4.8";
    for (const Camera& camera : path) {
      EXPECT_LT(Norm(camera.Center()), 3.05);  // the photos' own distance is sqrt(9.25)
      EXPECT_GT(Dot(camera.Forward(), Normalized(-camera.Center())), 0.95);
    }
  }
}

TEST(CameraPath, OrderIsATourWithoutDetours) {
  const std::vector<Camera> cameras = Arc(15, true);
  const std::vector<int> order = SmoothOrder(cameras);
  std::vector<int> sorted = order;
  std::sort(sorted.begin(), sorted.end());
  for (int i = 0; i < 15; ++i) EXPECT_EQ(sorted[static_cast<size_t>(i)], i);
  double length = 0;
  for (size_t i = 1; i < order.size(); ++i)
    length += Norm(cameras[static_cast<size_t>(order[i])].Center() -
                   cameras[static_cast<size_t>(order[i - 1])].Center());
  EXPECT_NEAR(length, 4.8, 0.1);
}

TEST(CameraPath, OrbitAndSpiralLookAtTheScene) {
  for (const char* name : {"orbit", "spiral"}) {
    const std::vector<Camera> path = MakeCameraPath(Arc(15, false), {name, 24});
    ASSERT_EQ(path.size(), 24u);
    ExpectCameras(path);
    for (const Camera& camera : path)
      EXPECT_GT(Dot(camera.Forward(), Normalized(Vec3d{0, 0, 0} - camera.Center())), 0.7)
          << name;
  }
}

TEST(CameraPath, OneCameraStands) {
  const std::vector<Camera> path = MakeCameraPath(Arc(2, false), {"smooth", 5});
  ExpectCameras(path);
  std::vector<Camera> one = Arc(2, false);
  one.resize(1);
  for (const char* name : {"smooth", "orbit", "spiral"})
    ExpectCameras(MakeCameraPath(one, {name, 5}));
}

}  // namespace
}  // namespace regrade
