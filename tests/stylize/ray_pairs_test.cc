// Pairs of rays: neighbours, and pixels of two views that see one point; and what is measured
// of them in fields with spheres and of objects.
#include "stylize/field/ray_pairs.h"

#include <cmath>

#include "kernels/field/render_ray.h"
#include "stylize/field/blend_fields.h"
#include "stylize/field/volume_variance.h"
#include "tests/support/exact_weigher.h"
#include "tests/support/small_field.h"
#include "tests/support/styled_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

// Where a ray ends in an opaque field.
Vec3d EndOf(const RadianceField& field, const Ray& ray) {
  const RayResult<float> result = RenderRay(ViewOf(field), ray, MarchOptions{});
  const double length = result.depth / (1 - static_cast<double>(result.transmittance));
  return ray.origin.Cast<double>() + ray.direction.Cast<double>() * length;
}

// With a surface: light from every direction ends within a voxel of it.
RadianceField HardBall() {
  RadianceField ball = Ball(40);
  auto geometry = std::make_shared<Geometry>(*ball.geometry);
  for (int64_t i = 0; i < geometry->density.size(); ++i) geometry->density[i] *= 30;
  ball.geometry = geometry;
  return ball;
}

TEST(RayPairs, BothRaysEndAtOnePoint) {
  const RadianceField ball = HardBall();
  const std::vector<Camera> cameras = Ring(9, 60);  // 40 degrees apart
  const RayPairs pairs = PixelsOfOnePoint(ball, cameras, 1000, 3, ExactWeigher(ball).get());
  ASSERT_GT(pairs.size(), 1000);  // of 4000 pixels, two thirds on the ball
  for (size_t i = 0; i < pairs.rays.size(); i += 2) {
    const Vec3d a = EndOf(ball, pairs.rays[i]), b = EndOf(ball, pairs.rays[i + 1]);
    // 1 % of a depth of at most 2.2, along the ray; a hidden point would be up to 1.5 apart
    EXPECT_LT(Norm(a - b), 0.03);
    EXPECT_GT(Norm(pairs.rays[i].origin - pairs.rays[i + 1].origin),
              1);  // they are of two views
  }
}

// A wall between two cameras: what one sees, the other does not.
TEST(RayPairs, APointThatIsHiddenIsNoPair) {
  const std::vector<Camera> opposite{Ring(2, 60)};
  const auto pairs = [](const RadianceField& field, const std::vector<Camera>& cameras) {
    return PixelsOfOnePoint(field, cameras, 500, 3, ExactWeigher(field).get()).size();
  };
  EXPECT_EQ(pairs(HardBall(), opposite), 0);
  EXPECT_EQ(pairs(HardBall(), {Ring(1, 60)}), 0);
  RadianceField empty = Ball(8);
  auto geometry = std::make_shared<Geometry>(*empty.geometry);
  for (int64_t i = 0; i < geometry->density.size(); ++i) geometry->density[i] = -1;
  empty.geometry = geometry;
  EXPECT_EQ(pairs(empty, Ring(9, 60)), 0);
}

TEST(RayPairs, TheSameForAnyNumberOfThreads) {
  const RadianceField ball = Ball(20);
  const auto pairs = [&] {
    return PixelsOfOnePoint(ball, Ring(9, 60), 200, 5, ExactWeigher(ball).get());
  };
  const RayPairs one = [&] {
    const Threads single(1);
    return pairs();
  }();
  const RayPairs many = pairs();
  ASSERT_EQ(one.size(), many.size());
  for (size_t i = 0; i < one.rays.size(); ++i)
    EXPECT_EQ(Norm(one.rays[i].direction - many.rays[i].direction), 0);
}

TEST(RayPairs, FractionalPlacesAndPixelsAgree) {
  Camera camera = Ring(3, 60)[1];
  const Ray pixel = camera.PixelRay(7, 11), place = camera.FieldRay(7.5, 11.5);
  EXPECT_EQ(Norm(pixel.direction - place.direction), 0);
  const Vec3d ahead =
      camera.Center() + camera.FieldRay(20.25, 40.75).direction.Cast<double>() * 3.0;
  double u, v;
  ASSERT_TRUE(camera.Project(ahead, &u, &v));
  EXPECT_NEAR(u, 20.25, 1e-4);
  EXPECT_NEAR(v, 40.75, 1e-4);
}

// A ball that is restyled in front of styled spheres.
struct Surrounded {
  RadianceField source = Ball(20), styled;
  LipschitzNetwork network = RandomNetwork(301, 0.9);
  std::vector<Camera> cameras = Ring(9, 60);

  Surrounded() {
    network.data().has_base = true;
    network.data().base = SomeMap();
    for (int64_t i = 0; i < source.appearance.sh.size(); ++i) source.appearance.sh[i] *= 0.3f;
  }
  void Style() {
    styled = source;
    styled.appearance = ApplyNetwork(network, source);
  }
};

double RenderedDifference(const RadianceField& field, const RayPairs& pairs) {
  double sum = 0;
  for (size_t i = 0; i < pairs.rays.size(); i += 2) {
    const auto color = [&](const Ray& ray) {
      return RenderRay(ViewOf(field), ray, MarchOptions{}).color.Cast<double>();
    };
    sum += Norm(color(pairs.rays[i]) - color(pairs.rays[i + 1]));
  }
  return sum;
}

TEST(VolumeVariance, PairsOnSpheresAreAGroupAndDifferAsRendered) {
  Surrounded scene;
  AddSpheres(3, 8, 1.0, 4, &scene.source);
  scene.Style();
  const RayPairs pairs = NeighbouringPixels(scene.cameras, 2000, 3);
  const VarianceReport report = MeasureVariance(scene.source, scene.styled, scene.network,
                                                pairs, ExactWeigher(scene.source).get());
  EXPECT_EQ(report.Pairs(), 2000);
  EXPECT_GT(report.spheres.pairs, 500);
  EXPECT_GT(report.valid.pairs, 200);
  const double source = report.spheres.sum_source + report.valid.sum_source +
                        report.clamped.sum_source + report.transparent.sum_source,
               styled = report.spheres.sum_styled + report.valid.sum_styled +
                        report.clamped.sum_styled + report.transparent.sum_styled;
  // Float's rounding of a colour, 2000 times: 2000 * 1e-6.
  EXPECT_NEAR(source, RenderedDifference(scene.source, pairs), 2e-3);
  EXPECT_NEAR(styled, RenderedDifference(scene.styled, pairs), 2e-3);
  EXPECT_LE(report.largest_fraction, 1 + 1e-4);
}

TEST(VolumeVariance, PixelsOfOnePointStayBelowTheBound) {
  Surrounded scene;
  scene.Style();
  const RayPairs pairs =
      PixelsOfOnePoint(scene.source, scene.cameras, 2000, 3, ExactWeigher(scene.source).get());
  const VarianceReport report = MeasureVariance(scene.source, scene.styled, scene.network,
                                                pairs, ExactWeigher(scene.source).get());
  EXPECT_GT(report.valid.pairs, 500);
  EXPECT_LE(report.largest_fraction, 1 + 1e-4);
  EXPECT_GT(report.largest_fraction, 0.05);
}

TEST(VolumeVariance, AnObjectsBoundIsThatOfItsWholeVoxels) {
  Surrounded scene;
  scene.Style();
  const GridFrame& frame = scene.source.geometry->frame;
  const std::vector<int32_t> vertex = VertexOfVoxel(*scene.source.geometry);
  std::vector<float> weights;
  for (const int32_t v : vertex) {
    const int n = frame.resolution.y * frame.resolution.z;
    const float x = static_cast<float>(v / n) / static_cast<float>(frame.resolution.x);
    weights.push_back(std::clamp(10 * (x - 0.45f), 0.0f, 1.0f));
  }
  const RadianceField whole = scene.styled;
  scene.styled = MixFields(scene.source, {&whole}, {1}, &weights);
  const RayPairs pairs = NeighbouringPixels(scene.cameras, 3000, 3);
  const VarianceReport report =
      MeasureVariance(scene.source, scene.styled, scene.network, pairs,
                      ExactWeigher(scene.source).get(), &weights);
  EXPECT_GT(report.valid.pairs, 50);  // opaque, on the whole half
  EXPECT_GT(report.partial.pairs, 200);
  EXPECT_LE(report.largest_fraction, 1 + 1e-4);
  EXPECT_GE(report.k, 1);
  // What is not of the object does not change.
  const std::vector<float> none(weights.size(), 0.0f);
  const VarianceReport outside =
      MeasureVariance(scene.source, scene.source, scene.network, pairs,
                      ExactWeigher(scene.source).get(), &none);
  EXPECT_EQ(outside.valid.pairs, 0);
  EXPECT_EQ(outside.partial.above, 0);
  EXPECT_NEAR(outside.partial.Gain(), 1, 1e-12);
}

}  // namespace
}  // namespace regrade
