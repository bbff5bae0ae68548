// Paths of the film's camera: smooth, within the photos' hull, looking where they look.
#include "pipeline/fields/camera_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "kernels/render/optical_depth.h"
#include "kernels/scene/facing.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/fields/film_timing.h"
#include "pipeline/fields/path_clearance.h"

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
    c.camera_from_world = Facing(center, forward, right);
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
    const std::vector<Camera> path =
        MakeCameraPath(Arc(15, shuffled), {"smooth"}, EvenMoments(60));
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
    const std::vector<Camera> path = MakeCameraPath(Arc(15, false), {name}, EvenMoments(24));
    ASSERT_EQ(path.size(), 24u);
    ExpectCameras(path);
    for (const Camera& camera : path)
      EXPECT_GT(Dot(camera.Forward(), Normalized(Vec3d{0, 0, 0} - camera.Center())), 0.7)
          << name;
  }
}

TEST(CameraPath, BeginsAndEndsAtRestWithoutJumps) {
  EXPECT_EQ(EasedWay(0), 0);
  EXPECT_EQ(EasedWay(1), 1);
  EXPECT_NEAR(EasedWay(0.5), 0.5, 1e-12);
  constexpr int kFrames = 180;
  const std::vector<Camera> path =
      MakeCameraPath(Arc(15, false), {"smooth"}, EvenMoments(kFrames));
  std::vector<double> steps;
  for (int i = 1; i < kFrames; ++i)
    steps.push_back(Norm(path[static_cast<size_t>(i)].Center() -
                         path[static_cast<size_t>(i - 1)].Center()));
  const double most = *std::max_element(steps.begin(), steps.end());
  // The first step of a constant acceleration over 27 frames is 1/54 of full speed.
  EXPECT_LT(steps.front(), 0.05 * most);
  EXPECT_LT(steps.back(), 0.05 * most);
  for (size_t i = 1; i < steps.size(); ++i)
    EXPECT_LT(std::abs(steps[i] - steps[i - 1]), 0.1 * most) << i;  // nor does speed jump
}

// A slab of voxels, 100 per unit of length: e^-19 through 3 / 16.
RadianceField WallOfVoxels() {
  auto geometry = std::make_shared<Geometry>();
  constexpr int kN = 32;
  geometry->frame = {{kN, kN, kN}, {0, 0, 0}, {1, 1, 1}};
  geometry->links.Resize(kN * kN * kN);
  for (int x = 0; x < kN; ++x)
    for (int y = 0; y < kN; ++y)
      for (int z = 0; z < kN; ++z)
        geometry->links[geometry->frame.Vertex(x, y, z)] = std::abs(x - kN / 2) < 2 ? 0 : -1;
  geometry->density.Resize(1);
  geometry->density[0] = 100;
  RadianceField field;
  field.geometry = geometry;
  return field;
}

// Discs of opacity 0.99 across x = 0, turned by a quarter about z from their own y axis.
RadianceField WallOfSplats() {
  Splats splats(9, 1);
  for (int i = 0; i < 9; ++i) {
    Splat<float> splat;
    splat.mean = {0, 0.25f * static_cast<float>(i / 3 - 1),
                  0.25f * static_cast<float>(i % 3 - 1)};
    splat.log_scale = {std::log(0.3f), std::log(0.01f), std::log(0.3f)};
    splat.quaternion[0] = splat.quaternion[3] = 2;
    splat.opacity_logit = std::log(99.0f);
    splats.Set(i, splat);
  }
  return FieldOfSplats(splats, {{}, {0, 0, 0}, {1, 1, 1}}, 0, -1);
}

// Photos' places beside a wall: a path along them is clear, one through the wall is not.
TEST(PathClearance, FindsAPathThroughASurface) {
  std::vector<Camera> photos = Arc(6, false);
  const auto place = [](double x, double y) {
    Camera camera = Arc(2, false)[0];
    camera.camera_from_world.rotation = Mat3d();
    camera.camera_from_world.translation = {-x, -y, 0};
    return camera;
  };
  for (int i = 0; i < 6; ++i) photos[static_cast<size_t>(i)] = place(-0.6, -0.5 + 0.2 * i);
  std::vector<Camera> beside, through;
  for (int i = 0; i <= 40; ++i) {
    beside.push_back(place(-0.5, -0.5 + 0.025 * i));
    through.push_back(place(-0.6 + 0.03 * i, 0));
  }
  for (const RadianceField& field : {WallOfVoxels(), WallOfSplats()}) {
    const PathClearance clear = MeasureClearance(field, photos, beside);
    EXPECT_EQ(clear.transmittance, 1);
    EXPECT_LE(clear.photo_distance, std::hypot(0.1, 0.1) / 0.2 + 1e-9);
    EXPECT_GT(clear.photo_distance, 0.45);
    const PathClearance blocked = MeasureClearance(field, photos, through);
    EXPECT_LT(blocked.transmittance, 1e-3);
    EXPECT_GT(blocked.photo_distance, 5);
  }
}

// The parts of a line add up to what the splat hides along it, however it is cut.
TEST(PathClearance, SegmentsOfALineAddUpToTheSplatsOpacity) {
  Splats splats(1, 1);
  Splat<float> splat;
  splat.mean = {0.1f, 0.2f, -0.1f};
  splat.log_scale = {-1, -2, -1.5f};
  splat.quaternion[0] = 0.9f, splat.quaternion[1] = 0.2f, splat.quaternion[2] = -0.3f;
  splat.opacity_logit = 1;
  splats.Set(0, splat);
  const RadianceField field = FieldOfSplats(splats, {{}, {0, 0, 0}, {1, 1, 1}}, 0, -1);
  const Vec3d mean = splat.mean.Cast<double>(), way{3, 1, 2};
  std::vector<Vec3d> path;
  for (const double t : {-1.0, -0.1, -0.02, 0.05, 0.3, 1.0}) path.push_back(mean + way * t);
  double depth = 0;
  for (const double part : SplatDepthAlong(field, path)) depth += part;
  EXPECT_NEAR(1 - std::exp(-depth), 1 / (1 + std::exp(-1.0)), 1e-6);
}

TEST(FilmTiming, SamplesAreAtFixedTimesWhateverTheRate) {
  for (const double rate : {24.0, 30.0, 60.0}) {
    const FilmSamples samples = SamplesOfFilm(6, rate);
    ASSERT_EQ(samples.moments.size(), 60u);
    EXPECT_EQ(samples.excerpt, 20);
    const double length = (FilmFrames(6, rate) - 1) / rate;
    for (int i = 1; i < 60; ++i) {
      const double gap = (samples.moments[static_cast<size_t>(i)] -
                          samples.moments[static_cast<size_t>(i - 1)]) *
                         length;
      if (i % 20 == 0)
        EXPECT_GT(gap, 0.5) << i;  // between excerpts
      else
        EXPECT_NEAR(gap, 1.0 / 24, 1e-9) << i;
    }
    EXPECT_GE(samples.moments.front(), 0);
    EXPECT_LE(samples.moments.back(), 1);
  }
  // At 24 a second the samples of a short film are its frames.
  const FilmSamples all = SamplesOfFilm(0.125, 24);
  EXPECT_EQ(all.moments.size(), 3u);
  EXPECT_EQ(all.moments.back(), 1);
  EXPECT_EQ(FilmFrames(0.125, 24), 3);
}

TEST(CameraPath, OneCameraStands) {
  const std::vector<Camera> path = MakeCameraPath(Arc(2, false), {"smooth"}, EvenMoments(5));
  ExpectCameras(path);
  std::vector<Camera> one = Arc(2, false);
  one.resize(1);
  for (const char* name : {"smooth", "orbit", "spiral"})
    ExpectCameras(MakeCameraPath(one, {name}, EvenMoments(5)));
}

}  // namespace
}  // namespace regrade
