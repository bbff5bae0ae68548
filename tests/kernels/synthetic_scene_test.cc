// Synthetic scenes: exact ground truth, reproducible pictures, and bounds that contain all that
// cameras see.
#include "kernels/synthetic/synthetic_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/synthetic/ray_trace.h"
#include "kernels/synthetic/solid_index.h"
#include "tests/support/expect_error.h"
#include "tests/support/pinhole.h"
#include "tests/support/threads.h"

namespace regrade {
namespace {

constexpr const char* kScenes[] = {"table", "wall", "room", "square", "street"};

// So many that neighbours overlap.
int ManyViews(const std::string& scene) { return scene == "street" ? 400 : 24; }

double Bilinear(const Image& image, double u, double v, int channel) {
  const double x = u - 0.5, y = v - 0.5;
  const int i = std::clamp(static_cast<int>(std::floor(x)), 0, image.width - 2);
  const int j = std::clamp(static_cast<int>(std::floor(y)), 0, image.height - 2);
  const double a = x - i, b = y - j;
  return (1 - b) * ((1 - a) * image.at(i, j)[channel] + a * image.at(i + 1, j)[channel]) +
         b * ((1 - a) * image.at(i, j + 1)[channel] + a * image.at(i + 1, j + 1)[channel]);
}

class EveryScene : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(SyntheticScene, EveryScene, ::testing::ValuesIn(kScenes));

TEST_P(EveryScene, SameBytesForAnyNumberOfThreads) {
  const SyntheticScene scene = MakeSyntheticScene(GetParam(), 3);
  const Camera camera = SyntheticCameras(scene, 24, 96, 72)[5];
  const auto with_threads = [&](int n) {
    const testing::Threads threads(n);
    return RenderSyntheticView(scene, camera);
  };
  const SyntheticView one = with_threads(1), three = with_threads(3);
  EXPECT_EQ(one.color.pixels, three.color.pixels);
  EXPECT_EQ(one.depth.pixels, three.depth.pixels);
}

TEST_P(EveryScene, SeedRepaintsButDoesNotMoveAnything) {
  const SyntheticScene a = MakeSyntheticScene(GetParam(), 0),
                       b = MakeSyntheticScene(GetParam(), 1);
  const Camera camera = SyntheticCameras(a, 24, 64, 48)[0];
  const SyntheticView in_a = RenderSyntheticView(a, camera),
                      in_b = RenderSyntheticView(b, camera);
  EXPECT_EQ(in_a.depth.pixels, in_b.depth.pixels);
  EXPECT_NE(in_a.color.pixels, in_b.color.pixels);
}

// A second view at the same position would be skipped as a duplicate.
TEST_P(EveryScene, NoTwoViewsShareAPosition) {
  const SyntheticScene scene = MakeSyntheticScene(GetParam(), 0);
  for (const int views : {12, 24, 50, 96}) {
    const std::vector<Camera> cameras = SyntheticCameras(scene, views, 64, 48);
    for (size_t i = 0; i < cameras.size(); ++i)
      for (size_t j = 0; j < i; ++j)
        EXPECT_GT(Norm(cameras[i].Center() - cameras[j].Center()), 0.3 / views)
            << i << " and " << j << " of " << views;
  }
}

// A grid over the bounds must be able to represent every pixel of every default view.
TEST_P(EveryScene, BoundsContainAllThatCamerasSee) {
  const SyntheticScene scene = MakeSyntheticScene(GetParam(), 0);
  for (const Camera& camera : SyntheticCameras(scene, 24, 640, 480))
    for (int y = 0; y < 480; y += 16)
      for (int x = 0; x < 640; x += 16) {
        const Hit hit = FindHit(scene.solids, camera.WorldRay(x + 0.5, y + 0.5), 1e-7);
        ASSERT_GE(hit.solid, 0);
        for (int a = 0; a < 3; ++a) {
          ASSERT_GE(hit.point[a], scene.bounds_min[a] - 1e-9);
          ASSERT_LE(hit.point[a], scene.bounds_max[a] + 1e-9);
        }
      }
}

TEST_P(EveryScene, DepthAgreesWithTheMotion) {
  const SyntheticScene scene = MakeSyntheticScene(GetParam(), 0);
  const std::vector<Camera> cameras = SyntheticCameras(scene, ManyViews(GetParam()), 80, 60);
  const SyntheticView view = RenderSyntheticView(scene, cameras[2]);
  const SyntheticMotion motion = TrueMotion(scene, cameras[2], cameras[3]);
  const RigidTransform world_from_camera = cameras[2].camera_from_world.Inverse();
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 80; ++x) {
      const Vec3d point = world_from_camera * (cameras[2].CameraRay(x + 0.5, y + 0.5) *
                                               static_cast<double>(*view.depth.at(x, y)));
      double u, v;
      ASSERT_TRUE(cameras[3].Project(point, &u, &v));
      const float* uv = &motion.uv[2 * (80 * y + x)];
      // Depth is stored as float: 1e-7 relative, times a motion of tens of pixels.
      ASSERT_NEAR(u - (x + 0.5), uv[0], 1e-3);
      ASSERT_NEAR(v - (y + 0.5), uv[1], 1e-3);
    }
}

// Without highlights surfaces look the same from everywhere, so view i + 1 warped by the exact
// motion equals view i up to the interpolation error. Where the mask is wrong, whole objects
// differ.
TEST_P(EveryScene, H124_WarpingByTrueMotionLeavesInterpolationErrorOnly) {
  const SyntheticScene scene = MakeSyntheticScene(GetParam(), 0);
  const std::vector<Camera> cameras = SyntheticCameras(scene, ManyViews(GetParam()), 320, 240);
  for (const int i : {0, 9}) {
    const SyntheticView a = RenderSyntheticView(scene, cameras[i]);
    const SyntheticView b = RenderSyntheticView(scene, cameras[i + 1]);
    const SyntheticMotion motion = TrueMotion(scene, cameras[i], cameras[i + 1]);
    double sum = 0;
    int64_t count = 0, wrong = 0;
    for (int y = 0; y < 240; ++y)
      for (int x = 0; x < 320; ++x) {
        const size_t pixel = 320 * y + x;
        if (!motion.visible[pixel]) continue;
        double worst = 0;
        for (int c = 0; c < 3; ++c) {
          const double e = Bilinear(b.color, x + 0.5 + motion.uv[2 * pixel],
                                    y + 0.5 + motion.uv[2 * pixel + 1], c) -
                           a.color.at(x, y)[c];
          sum += e * e;
          worst = std::max(worst, std::abs(e));
        }
        ++count;
        wrong += worst > 0.25;
      }
    ASSERT_GT(count, 320 * 240 / 2);
    const double psnr = -10 * std::log10(sum / (3.0 * count));
    // Edges of paint and of objects cover a few per cent of the pixels; there bilinear
    // interpolation between different pixel grids may be off by a third of the contrast.
    EXPECT_GT(psnr, 30) << "views " << i << ", " << i + 1;
    EXPECT_LT(static_cast<double>(wrong) / count, 0.005);
  }
}

// The index leaves out only what rays miss: rays between random places, along the axes, and
// from surfaces to the sun.
TEST_P(EveryScene, IndexFindsTheSameHitsAsATestOfAllSolids) {
  const SyntheticScene scene = MakeSyntheticScene(GetParam(), 0);
  const SolidIndex index(scene.solids);
  uint64_t draws = 0;
  const auto number = [&] { return 2 * RandomDouble(5, 0, ++draws) - 1; };
  const Vec3d extent = GetParam() == std::string("street") ? Vec3d{150, 14, 9} : Vec3d{2, 2, 2};
  int hits = 0, shadows = 0;
  for (int i = 0; i < 3000; ++i) {
    RayT<double> ray;
    for (int a = 0; a < 3; ++a) ray.origin[a] = extent[a] * number();
    for (int a = 0; a < 3; ++a) ray.direction[a] = number();
    if (i % 4 == 0) ray.direction[i % 3] = 0;
    if (i % 16 == 0) ray.direction[(i + 1) % 3] = 0;
    ray.direction = Normalized(ray.direction);
    const Hit hit = index.FindHit(ray, 1e-7), plain = FindHit(scene.solids, ray, 1e-7);
    ASSERT_EQ(hit.solid, plain.solid);
    ASSERT_EQ(hit.distance, plain.distance);
    ASSERT_EQ(hit.point, plain.point);
    ASSERT_EQ(hit.normal, plain.normal);
    ASSERT_EQ(hit.u, plain.u);
    ASSERT_EQ(hit.v, plain.v);
    if (hit.solid < 0) continue;
    const RayT<double> to_sun = {hit.point + hit.normal * 1e-7, scene.to_sun};
    const bool shadowed = IsShadowed(scene.solids, to_sun, 1e-7);
    ASSERT_EQ(index.IsShadowed(to_sun, 1e-7), shadowed);
    const std::vector<int> found = index.ThoseInReach(hit.point);
    ASSERT_TRUE(std::ranges::is_sorted(found));
    for (size_t s = 0; s < scene.solids.size(); ++s)
      ASSERT_TRUE(Norm(scene.solids[s].center - hit.point) > ContactReach(scene.solids[s]) ||
                  std::ranges::binary_search(found, static_cast<int>(s)));
    ++hits;
    shadows += shadowed;
  }
  EXPECT_GT(hits, 500);
  EXPECT_GT(shadows, 100);
}

// From a point to the solid, 0 inside it; from a sphere's surface, as the dome has all inside.
double DistanceTo(const Solid& solid, const Vec3d& point) {
  const Vec3d offset = point - solid.center;
  if (solid.shape == Shape::kSphere) return std::abs(Norm(offset) - solid.half.x);
  const Vec3d local = {solid.cos_yaw * offset.x + solid.sin_yaw * offset.y,
                       solid.cos_yaw * offset.y - solid.sin_yaw * offset.x, offset.z};
  Vec3d beyond;
  for (int a = 0; a < 3; ++a) beyond[a] = std::max(0.0, std::abs(local[a]) - solid.half[a]);
  if (solid.shape == Shape::kCylinder)
    beyond = {std::max(0.0, std::hypot(local.x, local.y) - solid.half.x), 0, beyond.z};
  return Norm(beyond);
}

TEST(SyntheticScene, CamerasOfTheStreetAreClearAndNearTheirNeighbours) {
  const SyntheticScene scene = MakeSyntheticScene("street", 0);
  const std::vector<Camera> cameras = SyntheticCameras(scene, 400, 800, 600);
  for (size_t i = 0; i < cameras.size(); ++i) {
    const Vec3d center = cameras[i].Center();
    for (const Solid& solid : scene.solids) ASSERT_GT(DistanceTo(solid, center), 0.8) << i;
    const Camera& next = cameras[(i + 1) % cameras.size()];
    EXPECT_LT(Norm(next.Center() - center), 1.7) << i;
    EXPECT_GT(Dot(next.Forward(), cameras[i].Forward()), std::cos(4 * M_PI / 180)) << i;
  }
}

TEST(SyntheticScene, VisibleMeansUnoccluded) {
  // A ball before a wall: the other camera, to the left, cannot see the wall right of the ball.
  SyntheticScene scene;
  Solid wall, ball;
  wall.shape = Shape::kBox;
  wall.center = {0, 2, 0};
  wall.half = {4, 0.1, 4};
  ball.center = {0, 0, 0};
  ball.half = {0.4, 0, 0};
  scene.solids = {wall, ball};
  Camera from = testing::PinholeOf(100, 100, 100);
  from.camera_from_world.rotation.row[0] = {1, 0, 0};
  from.camera_from_world.rotation.row[1] = {0, 0, -1};
  from.camera_from_world.rotation.row[2] = {0, 1, 0};
  from.camera_from_world.translation = {0, 0, 2};
  Camera to = from;
  to.camera_from_world.translation = {0.5, 0, 2};  // its centre is at x = -0.5
  const SyntheticMotion motion = TrueMotion(scene, from, to);
  const auto at = [&](int x, int y) { return motion.visible[100 * y + x]; };
  EXPECT_TRUE(at(50, 50));   // the ball's middle
  EXPECT_FALSE(at(73, 50));  // wall just to the right of the ball
  EXPECT_TRUE(at(25, 50));   // wall just to its left
  EXPECT_FALSE(at(95, 50));  // outside the other picture
  // The motion: f * baseline / depth for the ball's front at depth 1.6.
  EXPECT_NEAR(motion.uv[2 * (100 * 50 + 50)], 100 * 0.5 / 1.6, 0.01);
}

TEST(SyntheticScene, HighlightsDependOnTheViewAndAreOffBitwise) {
  const SyntheticScene scene = MakeSyntheticScene("table", 0);
  SyntheticScene matte = scene;
  for (Solid& solid : matte.solids) solid.gloss = 0;
  const Camera camera = SyntheticCameras(scene, 24, 160, 120)[12];
  const SyntheticView plain = RenderSyntheticView(scene, camera);
  EXPECT_EQ(plain.color.pixels, RenderSyntheticView(matte, camera).color.pixels);
  EXPECT_EQ(plain.color.pixels, RenderSyntheticView(matte, camera, true).color.pixels);
  const SyntheticView glossy = RenderSyntheticView(scene, camera, true);
  EXPECT_EQ(plain.depth.pixels, glossy.depth.pixels);
  int brighter = 0;
  for (size_t i = 0; i < plain.color.pixels.size(); ++i) {
    EXPECT_GE(glossy.color.pixels[i], plain.color.pixels[i] - 0.02);
    brighter += glossy.color.pixels[i] > plain.color.pixels[i] + 0.1;
  }
  EXPECT_GT(brighter, 20);
}

TEST(SyntheticScene, UnknownNameIsUsageAndListsTheScenes) {
  EXPECT_REGRADE_ERROR(MakeSyntheticScene("garden", 0), ExitCode::kUsage, "table|wall|room");
}

}  // namespace
}  // namespace regrade
