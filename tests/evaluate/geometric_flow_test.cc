#include "evaluate/geometric_flow.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "evaluate/consistency.h"
#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

using namespace regrade::testing;

constexpr int kPlaneW = 120, kPlaneH = 90;

Camera CameraAt(Vec3d center, double turn) {
  Camera camera;
  camera.width = kPlaneW;
  camera.height = kPlaneH;
  camera.fx = 110;
  camera.fy = 115;
  camera.cx = 61.3;
  camera.cy = 44.2;
  Mat3d& r = camera.camera_from_world.rotation;
  r(0, 0) = r(2, 2) = std::cos(turn);
  r(0, 2) = std::sin(turn);
  r(2, 0) = -std::sin(turn);
  camera.camera_from_world.translation = -(r * center);
  return camera;
}

// Distance along each pixel's ray to the plane z = 4 + 0.3 x, and to the square |x|, |y| < 0.4
// at z = 2 in front of it if `square` is set.
Image DepthOf(const Camera& camera, bool square) {
  Image depth(kPlaneW, kPlaneH, 1);
  for (int y = 0; y < kPlaneH; ++y)
    for (int x = 0; x < kPlaneW; ++x) {
      const RayT<double> ray = camera.WorldRay(x + 0.5, y + 0.5);
      const Vec3d &o = ray.origin, &d = ray.direction;
      double t = (4 + 0.3 * o.x - o.z) / (d.z - 0.3 * d.x);
      const double near = (2 - o.z) / d.z;
      const Vec3d p = o + d * near;
      if (square && std::abs(p.x) < 0.4 && std::abs(p.y) < 0.4) t = near;
      *depth.at(x, y) = static_cast<float>(t);
    }
  return depth;
}

TEST(GeometricFlow, H124_PlaneLeavesTheInterpolationErrorOnly) {
  const Camera a = CameraAt({0, 0, 0}, 0), b = CameraAt({0.25, 0.1, -0.1}, 0.03);
  const Image depth_a = DepthOf(a, false), depth_b = DepthOf(b, false);
  // Colours are a function of the point's position in picture b, so picture b is exact and its
  // second derivatives are known: 0.3 (k1^2 + k2^2) in each direction at most.
  const double k1 = 0.21, k2 = 0.17;
  const auto colour = [&](double u, double v) {
    return 0.5 + 0.3 * std::sin(k1 * u + k2 * v) * std::cos(k2 * u - k1 * v);
  };
  Image picture_a(kPlaneW, kPlaneH, 3), picture_b(kPlaneW, kPlaneH, 3);
  double worst_flow = 0;
  PairMotion motion;
  Image visible;
  motion.flow = GeometricFlow(depth_a, a, depth_b, b, &visible);
  motion.mask = GeometricMask(motion.flow, visible);
  for (int y = 0; y < kPlaneH; ++y)
    for (int x = 0; x < kPlaneW; ++x) {
      const RayT<double> ray = a.WorldRay(x + 0.5, y + 0.5);
      const double t =
          (4 + 0.3 * ray.origin.x - ray.origin.z) / (ray.direction.z - 0.3 * ray.direction.x);
      double u, v;
      ASSERT_TRUE(b.Project(ray.origin + ray.direction * t, &u, &v));
      worst_flow = std::max(worst_flow, std::hypot(u - 0.5 - x - motion.flow.at(x, y)[0],
                                                   v - 0.5 - y - motion.flow.at(x, y)[1]));
      for (int c = 0; c < 3; ++c) {
        picture_a.at(x, y)[c] = static_cast<float>(colour(u, v));
        picture_b.at(x, y)[c] = static_cast<float>(colour(x + 0.5, y + 0.5));
      }
    }
  EXPECT_LT(worst_flow, testing::RecordBound(
                            "flow of a plane, pixels", testing::Computed::kFloat, worst_flow,
                            2e-5));  // depth and flow are float: 1e-7 of 100 px
  EXPECT_GT(motion.mask.Coverage(), 0.75);
  EXPECT_EQ(motion.mask.disoccluded, 0);
  EXPECT_GT(motion.mask.out_of_frame, 100);

  // Linear interpolation of step 1 errs by at most (|g_xx| + |g_yy|) / 8; both derivatives of
  // the product are bounded by 0.3 (k1 + k2)^2.
  const double bound = 2 * 0.3 * (k1 + k2) * (k1 + k2) / 8;
  const PairResult pair = ComparePair(picture_a, picture_b, motion);
  EXPECT_LT(*pair.error, bound * bound *
                             testing::RecordBound("squared error over the interpolation error",
                                                  testing::Computed::kDouble,
                                                  *pair.error / (bound * bound), 1));
  EXPECT_GT(*pair.error, 1e-4 * bound * bound);
  // A shift of half a pixel would be detected.
  PairMotion slipped = motion;
  for (float& value : slipped.flow.uv) value += 0.5f;
  EXPECT_GT(*ComparePair(picture_a, picture_b, slipped).error, bound * bound);
}

TEST(GeometricFlow, H124_TheSameThroughEvaluateConsistency) {
  const Camera cameras[] = {CameraAt({0, 0, 0}, 0), CameraAt({0.1, 0, 0}, 0)};
  ConsistencyOptions options;
  options.gaps = {1};
  options.mode = "geometry";
  const FrameSource grey =
      Frames({ConstantImage(kPlaneW, kPlaneH, 0.5f), ConstantImage(kPlaneW, kPlaneH, 0.6f)});
  const auto report = EvaluateConsistency(grey, {{"s", grey}}, options, {}, [&](int i) {
    return FrameGeometry{DepthOf(cameras[i], false), cameras[i]};
  });
  EXPECT_NEAR(*report.rows.at(0).tc_psnr_mean_db, 20, 1e-4);
  EXPECT_GT(report.rows.at(0).coverage, 0.8);
}

TEST(GeometricFlow, HiddenPointsFailTheDepthTest) {
  const Camera a = CameraAt({0, 0, 0}, 0), b = CameraAt({0.5, 0, 0}, 0);
  Image visible;
  const FlowField flow = GeometricFlow(DepthOf(a, true), a, DepthOf(b, true), b, &visible);
  // Directly left of the square in a, the wall is hidden by the square in b; on the square and
  // far from it nothing is hidden. The test checks with a ray of b.
  int wrong = 0, hidden = 0;
  const Image depth_a = DepthOf(a, true);
  for (int y = 0; y < kPlaneH; ++y)
    for (int x = 0; x < kPlaneW; ++x) {
      const RayT<double> ray = a.WorldRay(x + 0.5, y + 0.5);
      const Vec3d p = ray.origin + ray.direction * static_cast<double>(*depth_a.at(x, y));
      const Vec3d to_b = b.Center() - p;
      const Vec3d crossing = p + to_b * ((2 - p.z) / (b.Center().z - p.z));
      const bool on_square = p.z < 2.001;
      const double side = std::max(std::abs(crossing.x), std::abs(crossing.y));
      if (on_square || std::abs(side - 0.4) < 0.04) continue;  // undefined at silhouettes
      if (side < 0.4) {
        ++hidden;
        wrong += *visible.at(x, y) != 0;
      }
    }
  EXPECT_GT(hidden, 200);
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(*visible.at(61, 44), 1);  // the square's middle
  EXPECT_EQ(GeometricMask(flow, visible).disoccluded,
            std::count(visible.pixels.begin(), visible.pixels.end(), 0.f) -
                GeometricMask(flow, visible).out_of_frame);
}

// The wall z = `z(x)` as seen by camera a.
Image DepthOfColumns(const Camera& camera, const std::function<double(int)>& z) {
  Image depth(kPlaneW, kPlaneH, 1);
  for (int y = 0; y < kPlaneH; ++y)
    for (int x = 0; x < kPlaneW; ++x)
      *depth.at(x, y) = static_cast<float>(z(x) * Norm(camera.CameraRay(x + 0.5, y + 0.5)));
  return depth;
}

TEST(GeometricFlow, DepthsOfTheSameSurfaceAgreeWithinOnePercent) {
  const Camera a = CameraAt({0, 0, 0}, 0);
  const Image depth = DepthOfColumns(a, [](int) { return 4.0; });
  for (const double factor : {0.97, 0.995, 1.005, 1.03}) {
    Image visible;
    GeometricFlow(depth, a, DepthOfColumns(a, [=](int) { return 4 * factor; }), a, &visible);
    EXPECT_EQ(*visible.at(50, 40), std::abs(factor - 1) < 0.01) << factor;
  }
}

TEST(GeometricFlow, H117_TapsOnTwoSurfacesAreNoSurface) {
  // Half a pixel to the side: each target lies between a near and a far column whose mean 1/z
  // happens to equal the point's.
  const Camera a = CameraAt({0, 0, 0}, 0);
  Camera b = a;
  b.cx += 0.5;
  Image visible;
  GeometricFlow(DepthOfColumns(a, [](int) { return 4.0; }), a,
                DepthOfColumns(b, [](int x) { return x % 2 ? 4 / 1.5 : 4 / 0.5; }), b,
                &visible);
  EXPECT_EQ(std::count(visible.pixels.begin(), visible.pixels.end(), 1.f), 0);
}

TEST(GeometricFlow, H116_NoSurfaceIsUnknown) {
  const Camera a = CameraAt({0, 0, 0}, 0);
  Image depth = DepthOf(a, false);
  *depth.at(5, 6) = 0;
  *depth.at(7, 8) = kNan;
  *depth.at(9, 10) = std::numeric_limits<float>::infinity();
  Image visible;
  const FlowField flow = GeometricFlow(depth, a, depth, a, &visible);
  EXPECT_EQ(GeometricMask(flow, visible).not_finite, 3);
  EXPECT_TRUE(std::isnan(flow.at(7, 8)[0]));
  EXPECT_NEAR(flow.at(50, 50)[0], 0, 1e-5);
  // H117: their neighbours lose a tap.
  for (const auto& [x, y] : {std::pair{5, 6}, {7, 8}, {9, 10}}) EXPECT_EQ(*visible.at(x, y), 0);
}

}  // namespace
}  // namespace regrade
