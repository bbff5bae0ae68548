// Views that are placed in splats without cameras: what is up, whether the scene is an object,
// a room or has surroundings, and what is not worth a look.
#include "reconstruct/views/place_views.h"

#include <gtest/gtest.h>

#include <cmath>

#include "kernels/splats/splat_field.h"
#include "reconstruct/views/probe_view.h"
#include "reconstruct/views/scene_extent.h"
#include "reconstruct/views/scene_up.h"
#include "tests/support/expect_error.h"
#include "tests/support/pinhole.h"
#include "tests/support/small_splats.h"

namespace regrade {
namespace {

// Collects splats; flat ones are discs of `size` with that axis.
class SceneMaker {
 public:
  void Disc(const Vec3d& at, const Vec3d& axis, double size) {
    Splat<float> splat;
    splat.mean = at.Cast<float>();
    const float wide = static_cast<float>(std::log(size));
    splat.log_scale = {wide, wide, wide - 3};
    // The turn from z to the axis.
    const Vec3d half = Normalized(axis) + Vec3d{0, 0, 1};
    const Vec3d q = Norm(half) > 1e-6 ? Normalized(half) : Vec3d{1, 0, 0};
    splat.quaternion[0] = static_cast<float>(q.z);
    splat.quaternion[1] = static_cast<float>(-q.y);
    splat.quaternion[2] = static_cast<float>(q.x);
    splat.quaternion[3] = 0;
    splat.opacity_logit = 5;
    all_.push_back(splat);
  }
  // Discs on the surface of a ball.
  void Ball(const Vec3d& middle, double radius, int count) {
    for (int i = 0; i < count; ++i) {
      const double z = 1 - (2 * i + 1.0) / count, turn = 2.399963 * i, r = std::sqrt(1 - z * z);
      const Vec3d way{r * std::cos(turn), r * std::sin(turn), z};
      Disc(middle + way * radius, way, 2.2 * radius / std::sqrt(count));
    }
  }
  // A square of 2 `half` wide with `side` x `side` discs.
  void Wall(const Vec3d& middle, const Vec3d& u, const Vec3d& v, double half, int side) {
    for (int i = 0; i < side; ++i)
      for (int j = 0; j < side; ++j)
        Disc(middle + u * (half * ((2 * i + 1.0) / side - 1)) +
                 v * (half * ((2 * j + 1.0) / side - 1)),
             Cross(u, v), 1.5 * half / side);
  }
  Splats Make() const {
    Splats splats(std::ssize(all_), 1);
    for (int64_t i = 0; i < splats.count(); ++i) splats.Set(i, all_[static_cast<size_t>(i)]);
    return splats;
  }

 private:
  std::vector<Splat<float>> all_;
};

RadianceField FieldOf(const Splats& splats) {
  const SplatExtent extent = ExtentOf(splats);
  const auto radius = static_cast<float>(extent.radius);
  return FieldOfSplats(splats, {{}, extent.center.Cast<float>(), {radius, radius, radius}}, 0,
                       -1);
}

PlacedViews Place(const Splats& splats, const Vec3d& up) {
  return PlaceViews(splats, FieldOf(splats), Backend::kCpu, up, 96, "scene.ply", {});
}

TEST(SceneUp, AGroundTurnsTheConventionToIt) {
  const double tilt = 0.2;
  const Vec3d normal{0, -std::cos(tilt), std::sin(tilt)};
  SceneMaker scene;
  scene.Wall({0, 1, 0}, {1, 0, 0}, Cross(normal, Vec3d{1, 0, 0}), 3, 24);
  scene.Ball({0, 0, 0}, 0.8, 900);
  EXPECT_GT(Dot(EstimateUp(scene.Make()).up, normal), std::cos(0.03));
}

TEST(SceneUp, ZIsUpWhereTheGroundIsThere) {
  SceneMaker scene;
  scene.Wall({0, 0, -1}, {1, 0, 0}, {0, 1, 0}, 3, 24);
  scene.Ball({0, 0, 0}, 0.8, 900);
  EXPECT_GT(EstimateUp(scene.Make()).up.z, 0.999);
}

// A wall in front of the cameras of a file with y down is no ground.
TEST(SceneUp, AWallIsNoGround) {
  SceneMaker scene;
  scene.Wall({0, 0, 2}, {1, 0, 0}, {0, 1, 0}, 3, 24);
  scene.Ball({0, 0, 0}, 0.8, 900);
  EXPECT_LT(EstimateUp(scene.Make()).up.y, -0.999);
}

TEST(PlaceViews, AnObjectIsSeenFromOutside) {
  SceneMaker scene;
  scene.Ball({5, 1, -3}, 2, 1500);
  const PlacedViews placed = Place(scene.Make(), {0, -1, 0});
  EXPECT_TRUE(placed.summary.starts_with("an object")) << placed.summary;
  ASSERT_GE(placed.cameras.size(), 24u);
  for (const Camera& camera : placed.cameras) {
    const Vec3d to = Vec3d{5, 1, -3} - camera.Center();
    EXPECT_GT(Norm(to), 4);
    EXPECT_LT(Norm(to), 9);
    EXPECT_GT(Dot(Normalized(to), camera.Forward()), 0.999);
    EXPECT_LT(camera.Center().y, 1.1);  // not from below
    EXPECT_EQ(camera.width, 96);
    EXPECT_EQ(camera.height, 72);
  }
}

TEST(PlaceViews, EqualSplatsGiveEqualViews) {
  SceneMaker scene;
  scene.Ball({0, 0, 0}, 1, 800);
  const PlacedViews a = Place(scene.Make(), {0, 0, 1}), b = Place(scene.Make(), {0, 0, 1});
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (size_t i = 0; i < a.cameras.size(); ++i)
    EXPECT_EQ(Norm(a.cameras[i].Center() - b.cameras[i].Center()), 0);
}

// Six walls of fine splats with things in it.
TEST(PlaceViews, ARoomIsSeenFromWithin) {
  SceneMaker scene;
  const Vec3d x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  for (const double side : {-3.0, 3.0}) {
    scene.Wall(x * side, y, z, 3, 40);
    scene.Wall(y * side, z, x, 3, 40);
    scene.Wall(z * side, x, y, 3, 40);
  }
  scene.Ball({1.5, 2.2, 1.5}, 0.7, 1500);
  scene.Ball({-1.8, 2.2, -1.2}, 0.7, 1500);
  const PlacedViews placed = Place(scene.Make(), {0, -1, 0});
  EXPECT_TRUE(placed.summary.starts_with("a scene")) << placed.summary;
  for (const Camera& camera : placed.cameras)
    for (int a = 0; a < 3; ++a) EXPECT_LT(std::abs(camera.Center()[a]), 3) << placed.summary;
}

// A thing on a floor under a far sky, as outdoors: no view from beyond the sky or below the
// floor.
TEST(PlaceViews, SurroundingsAreSeenFromWithin) {
  SceneMaker scene;
  scene.Ball({0, 0, 0}, 1, 4000);
  scene.Wall({0, 1.2, 0}, {1, 0, 0}, {0, 0, 1}, 8, 24);
  scene.Ball({0, 0, 0}, 20, 1200);
  const PlacedViews placed = Place(scene.Make(), {0, -1, 0});
  EXPECT_TRUE(placed.summary.starts_with("a scene")) << placed.summary;
  ASSERT_GE(placed.cameras.size(), 12u) << placed.summary;
  for (const Camera& camera : placed.cameras) {
    EXPECT_LT(Norm(camera.Center()), 10);
    EXPECT_LT(camera.Center().y, 1.2);
  }
}

// A part of the splats, enlarged, hides as much at the same depths.
TEST(PlaceViews, ProbesOfManySplatsSeeTheSurface) {
  SceneMaker scene;
  scene.Ball({0, 0, 0}, 1, 9000);
  const Splats splats = scene.Make();
  const RadianceField all = FieldOf(splats), some = FieldForProbes(splats, all, 2000);
  EXPECT_EQ(some.geometry->num_voxels(), 1800);
  EXPECT_EQ(FieldForProbes(splats, all, 9000).geometry->num_voxels(), 9000);
  Camera camera = testing::PinholeOf(48, 48, 48);
  camera.camera_from_world.translation = {0, 0, 3};
  const RenderedView exact = FieldRenderer(all, Backend::kCpu).Render(camera),
                     probe = FieldRenderer(some, Backend::kCpu).Render(camera);
  int compared = 0;
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 48; ++x)
      if (*exact.transmittance.at(x, y) < 0.01f && std::hypot(x - 23.5, y - 23.5) < 14) {
        ++compared;
        EXPECT_LT(*probe.transmittance.at(x, y), 0.1f);
        EXPECT_NEAR(*probe.depth.at(x, y), *exact.depth.at(x, y), 0.1);
      }
  EXPECT_GT(compared, 400);
}

TEST(PlaceViews, NothingToSeeIsRefused) {
  Splats splats(1, 1);
  splats.Set(0, {{0, 0, 0}, {-3, -3, -3}, {1, 0, 0, 0}, -9});
  EXPECT_REGRADE_ERROR(Place(splats, {0, -1, 0}), ExitCode::kInput, "--cameras");
}

}  // namespace
}  // namespace regrade
