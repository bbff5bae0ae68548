// LipRF of splats: gradient, training, objects, residual, and what is measured of pairs.
#include <omp.h>

#include "stylize/field/blend_fields.h"
#include "stylize/field/coefficient_fit.h"
#include "stylize/field/object_weights.h"
#include "stylize/field/ray_pairs.h"
#include "stylize/field/volume_variance.h"
#include "stylize/field/voxel_residual.h"
#include "stylize/training/restyle_field.h"
#include "tests/support/algorithm1.h"
#include "tests/support/exact_weigher.h"
#include "tests/support/expect_error.h"
#include "tests/support/record_error.h"
#include "tests/support/row_of_voxels.h"
#include "tests/support/splat_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

// --- gradient

RayWeights WeightsOf(const RadianceField& field, const StyleRays& batch) {
  return MakeRayWeigher(*field.geometry, field.near_clip, MarchOptions{})->Weigh(batch);
}

LipschitzNetwork BasedNetwork(uint64_t stream, int basis = 9) {
  LipschitzNetwork network = RandomNetwork(stream, 1.3, basis);
  network.data().has_base = true;
  network.data().base = SomeMap();
  return network;
}

// Nine harmonics a channel, or the 16 of degree 3.
class SplatStyleOf : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Harmonics, SplatStyleOf, ::testing::Values(9, 16));

TEST_P(SplatStyleOf, GradientAgainstRichardson) {
  const int basis = GetParam();
  const RadianceField field = SplatBall(60, 0.3f, basis);
  const StyleRays batch = SomeRays(2, 6);
  LipschitzNetwork network = BasedNetwork(90, basis);
  network.data().base.offset = {0.2, 0.2, 0.2};  // no clamp begins or ends within a step
  ExpectRichardson(network, field, WeightsOf(field, batch), batch, -8,
                   "gradient of splats through sigma, W, b and K");
}

TEST_P(SplatStyleOf, EqualsAlgorithm1) {
  const int basis = GetParam();
  const RadianceField field = SplatBall(3000, 1, basis);
  const StyleRays batch = SomeRays(1, 30);
  const LipschitzNetwork network = BasedNetwork(91, basis);
  std::vector<double> gradient = NoGradient(basis), expected = NoGradient(basis);
  const AggregationResult result =
      GradientAggregation(field, {.view_weight = 0.7}).Run(network, batch, &gradient);
  EXPECT_GT(result.touched_voxels, 100);
  EXPECT_LT(result.touched_voxels, 3000);
  const double scale = 1 / (3.0 * static_cast<double>(batch.rays.size()));
  const double loss =
      PlainGradient(network, field, WeightsOf(field, batch), batch, scale, 0.7, &expected);
  EXPECT_NEAR(result.loss, loss, 1e-5 * loss);
  EXPECT_LE(RelativeDifference(gradient, expected),
            RecordDigits("gradient of splats", Computed::kFloat,
                         RelativeDifference(gradient, expected), 1e-5));
}

TEST_P(SplatStyleOf, ThreadsDoNotChangeABit) {
  const int basis = GetParam();
  const RadianceField field = SplatBall(500, 1, basis);
  const StyleRays batch = SomeRays(3, 20);
  const LipschitzNetwork network = BasedNetwork(94, basis);
  std::vector<double> gradient[2] = {NoGradient(basis), NoGradient(basis)};
  for (int t = 0; t < 2; ++t) {
    const Threads threads(t == 0 ? 1 : 5);
    GradientAggregation(field, {}).Run(network, batch, &gradient[t]);
  }
  EXPECT_TRUE(
      RecordSameBits("splats, 1 and 5 threads", Computed::kFloat, gradient[0] == gradient[1]));
}

// --- training

TEST(SplatStyle, LeastSquaresFindALinearStyle) {
  const StyledSplats ball(800, 4, 40, LinearStyle);
  const ColorMap map = MapOf(ball).map;
  const Vec3f gray = LinearStyle({0, 0, 0}), red = LinearStyle({1, 0, 0});
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(map.offset[c], gray[c], 5e-3);
    EXPECT_NEAR(map.matrix(c, 0), red[c] - gray[c], 5e-3);
  }
}

TEST_P(SplatStyleOf, TrainingBeatsTheLinearMap) {
  const StyledSplats ball(800, 6, 40, CurvedStyle, GetParam());
  TrainNetworkOptions options;
  options.steps = 120;
  options.rays_per_step = 512;
  const TrainNetworkResult result =
      TrainNetwork(ball.field, ball.views, MapOf(ball), options, {});
  EXPECT_GT(result.psnr_db, result.linear_map_psnr_db + 3);
  EXPECT_LE(result.bound, 4 * result.k_est * (1 + 1e-9));
  EXPECT_LE(result.local_lipschitz_sampled, result.bound);
  // What was learned is what the renderer shows.
  RadianceField styled = ball.field;
  styled.appearance = ApplyNetwork(result.network, ball.field);
  const FieldRenderer renderer(styled, Backend::kCpu);
  double sum = 0, count = 0;
  for (size_t v = 0; v < ball.views.size(); ++v) {
    const Image shown = renderer.Render(ball.views[v].camera).color;
    for (size_t i = 0; i < shown.pixels.size(); ++i) {
      if (ball.masks[v].pixels[i / 3] < 0.5f) continue;
      sum += std::pow(
          double{shown.pixels[i]} - double{std::clamp(ball.targets[v].pixels[i], 0.0f, 1.0f)},
          2);
      ++count;
    }
  }
  EXPECT_NEAR(-10 * std::log10(sum / count), result.psnr_db, 2);
}

TEST(SplatStyle, AnObjectsSplatsAloneAreRestyled) {
  const StyledSplats ball(400, 3, 32, LinearStyle);
  TrainingTargets targets;
  for (size_t v = 0; v < ball.views.size(); ++v)
    targets.Add(ball.views[v], ball.photos[v], ball.targets[v], ball.masks[v]);
  std::vector<float> half(static_cast<size_t>(ball.field.geometry->num_voxels()));
  std::fill_n(half.begin(), 200, 1.0f);
  RestyleRequest request;
  request.options.steps = 20;
  request.options.rays_per_step = 256;
  request.object_weights = &half;
  int checks = 0;
  RestyleHooks hooks;
  hooks.check = [&](const RestyledField& result, RayWeigher* weigher) {
    ++checks;
    const StyleRays rays = SomeRays(1, 8);
    const RayWeights weights = weigher->Weigh(rays),
                     exact = ExactWeigher(result.source)->Weigh(rays);
    EXPECT_EQ(weights.first, exact.first);  // none is dropped, as in the training
    EXPECT_EQ(weights.transmittance, exact.transmittance);
  };
  const RestyledField restyled = Restyle(ball.field, targets, request, hooks);
  EXPECT_EQ(checks, 1);
  EXPECT_TRUE(restyled.notices.empty());
  EXPECT_EQ(restyled.styled.geometry, ball.field.geometry);
  int64_t changed[2] = {};
  for (int64_t i = 0; i < ball.field.appearance.sh.size(); ++i)
    changed[i / (200 * 27)] +=
        restyled.styled.appearance.sh[i] != restyled.source.appearance.sh[i];
  EXPECT_GT(changed[0], 5000);
  EXPECT_EQ(changed[1], 0);
}

// --- objects

// What masks of rendered truth call the upper half, splats of the upper half are.
TEST(SplatStyle, MasksVoteForTheirSplats) {
  const RadianceField field = SplatBall(600);
  const int64_t n = field.geometry->num_voxels();
  const auto height = [&](int64_t v) { return field.geometry->splats.mean[3 * v + 2]; };
  std::vector<float> upper(static_cast<size_t>(n));
  for (int64_t v = 0; v < n; ++v) upper[static_cast<size_t>(v)] = height(v) > 0;
  const FieldRenderer truth(WeightField(field, upper), Backend::kCpu);
  MaskVote vote(*field.geometry, field.near_clip, MarchOptions{});
  for (const Camera& camera : Ring(8, 48)) {
    const Image color = truth.Render(camera).color;
    Image mask(camera.width, camera.height, 1);
    for (size_t i = 0; i < mask.pixels.size(); ++i)
      mask.pixels[i] = color.pixels[3 * i] > 0.5f ? 1.0f : 0.0f;
    vote.Add(camera, mask);
  }
  const std::vector<float> weights = vote.Weights(0.5, 0.25);
  int64_t clear = 0, wrong = 0;
  for (int64_t v = 0; v < n; ++v) {
    if (std::abs(height(v)) < 0.15f) continue;  // splats are up to 0.1 wide
    ++clear;
    wrong += (weights[static_cast<size_t>(v)] > 0.5f) != (height(v) > 0);
  }
  EXPECT_GT(clear, 400);
  EXPECT_LT(wrong, clear / 20);  // those that no ray sees have weight 0
}

TEST(SplatStyle, StylesOfOtherSplatsAreNotMixed) {
  const RadianceField field = SplatBall(50);
  RadianceField other = field;
  auto moved = std::make_shared<Geometry>(*field.geometry);
  moved->splats.opacity_logit[7] += 0.1f;
  other.geometry = moved;
  EXPECT_FALSE(SameGeometry(*field.geometry, *other.geometry));
  EXPECT_TRUE(SameGeometry(*field.geometry, Geometry(*field.geometry)));
}

// --- residual

double SquaredError(const RadianceField& field, const std::vector<Camera>& cameras,
                    const std::vector<Image>& wanted) {
  const FieldRenderer renderer(field, Backend::kCpu);
  double sum = 0;
  for (size_t v = 0; v < cameras.size(); ++v) {
    const Image shown = renderer.Render(cameras[v]).color;
    for (size_t i = 0; i < shown.pixels.size(); ++i)
      sum += std::pow(double{shown.pixels[i]} - double{wanted[v].pixels[i]}, 2);
  }
  return sum;
}

// A ball in gentle colours, and pictures of it with one side brighter.
struct Edited {
  RadianceField field;
  std::vector<Camera> cameras = Ring(6, 40);
  std::vector<Image> wanted, missing;

  explicit Edited(int basis) : field(SplatBall(600, 0.3f, basis)) {
    RadianceField edited = field;
    for (int64_t v = 0; v < field.geometry->num_voxels(); ++v)
      for (int c = 0; c < 3; ++c)
        if (field.geometry->splats.mean[3 * v] > 0)
          edited.appearance.sh[basis * (3 * v + c)] += 0.5f;
    const FieldRenderer before(field, Backend::kCpu), after(edited, Backend::kCpu);
    for (const Camera& camera : cameras) {
      wanted.push_back(after.Render(camera).color);
      missing.push_back(wanted.back());
      const Image shown = before.Render(camera).color;
      for (size_t i = 0; i < shown.pixels.size(); ++i)
        missing.back().pixels[i] -= shown.pixels[i];
    }
  }
};

TEST_P(SplatStyleOf, AResidualShowsAnEdit) {
  const Edited scene(GetParam());
  const VoxelGraph graph = GraphOf(scene.field);
  const int64_t n = scene.field.geometry->num_voxels();
  EXPECT_EQ(graph.voxels, n);
  for (int64_t v = 0; v < n; ++v)
    EXPECT_GE(
        graph.first_edge[static_cast<size_t>(v) + 1] - graph.first_edge[static_cast<size_t>(v)],
        6);
  EXPECT_LT(std::ssize(graph.edges), 5 * n);
  ResidualRays rays;
  for (size_t v = 0; v < scene.cameras.size(); ++v)
    AddResidualRays(scene.field, scene.cameras[v], scene.missing[v], 1 << 20, 0, &rays);
  const auto fit = [&](int threads) {
    const Threads some(threads);
    return FitResidual(graph, rays, {}, {});
  };
  const std::vector<Vec3d> x = fit(1), again = fit(5);
  for (size_t v = 0; v < x.size(); ++v) ASSERT_TRUE(x[v] == again[v]) << v;
  // The edit is a constant of 0.5 Gamma_0 = 0.14 on one side.
  double sides[2] = {}, count[2] = {};
  for (int64_t v = 0; v < n; ++v) {
    const float side = scene.field.geometry->splats.mean[3 * v];
    if (std::abs(side) < 0.2f) continue;
    sides[side > 0] += x[static_cast<size_t>(v)].x, ++count[side > 0];
  }
  EXPECT_NEAR(sides[1] / count[1], 0.141, 0.01);
  EXPECT_NEAR(sides[0] / count[0], 0, 0.01);
  RadianceField fitted = scene.field;
  VoxelResidual residual;
  for (const Vec3d& color : x) residual.color.push_back(color.Cast<float>());
  AddResidual(residual, &fitted.appearance);
  EXPECT_LT(SquaredError(fitted, scene.cameras, scene.wanted),
            0.03 * SquaredError(scene.field, scene.cameras, scene.wanted));
}

TEST_P(SplatStyleOf, CoefficientsFitOtherPictures) {
  const Edited scene(GetParam());
  RadianceField other = scene.field;
  for (int64_t i = 0; i < other.appearance.sh.size(); ++i)
    other.appearance.sh[i] += static_cast<float>(0.1 * Random(96, static_cast<uint64_t>(i)));
  const FieldRenderer before(scene.field, Backend::kCpu), after(other, Backend::kCpu);
  std::vector<Image> wanted, missing;
  for (const Camera& camera : scene.cameras) {
    wanted.push_back(after.Render(camera).color);
    missing.push_back(wanted.back());
    const Image shown = before.Render(camera).color;
    for (size_t i = 0; i < shown.pixels.size(); ++i)
      missing.back().pixels[i] -= shown.pixels[i];
  }
  const auto fit = [&](int threads) {
    const Threads some(threads);
    return FitCoefficients(scene.field, scene.cameras, missing, {.steps = 20});
  };
  const RadianceField fitted = fit(1), again = fit(5);
  for (int64_t i = 0; i < fitted.appearance.sh.size(); ++i)
    ASSERT_EQ(fitted.appearance.sh[i], again.appearance.sh[i]);
  EXPECT_LT(SquaredError(fitted, scene.cameras, wanted),
            1e-2 * SquaredError(scene.field, scene.cameras, wanted));
}

// --- pairs

TEST_P(SplatStyleOf, PairsStayBelowTheirBound) {
  const RadianceField source = SplatBall(2500, 0.15f, GetParam());
  LipschitzNetwork network = RandomNetwork(301, 0.9, GetParam());
  network.data().has_base = true;
  network.data().base = SomeMap();
  network.data().base.offset = {0.1, 0.05, 0.1};
  RadianceField styled = source;
  styled.appearance = ApplyNetwork(network, source);
  const std::vector<Camera> cameras = Ring(9, 60);
  const auto weigher = ExactWeigher(source);
  const RayPairs neighbours = NeighbouringPixels(cameras, 2000, 3),
                 points = PixelsOfOnePoint(source, cameras, 2000, 3, weigher.get());
  EXPECT_EQ(neighbours.size(), 4000);
  EXPECT_GT(points.size(), 500);
  for (size_t i = 0; i < points.rays.size(); i += 2)
    EXPECT_NE(points.places[i].camera, points.places[i + 1].camera);
  for (const RayPairs& pairs : {neighbours, points}) {
    const VarianceReport report =
        MeasureVariance(source, styled, network, pairs, weigher.get());
    EXPECT_GT(report.valid.pairs, 200);
    EXPECT_GT(report.largest_fraction, 0.05);
    EXPECT_LE(report.largest_fraction, 1 + 1e-4);  // float's rounding of coefficients
  }
  // Thin splats before a background that is restyled by another map.
  auto thin = std::make_shared<Geometry>(*source.geometry);
  for (float& logit : thin->splats.opacity_logit) logit -= 5;
  RadianceField clear = source, clear_styled = styled;
  clear.geometry = clear_styled.geometry = thin;
  clear_styled.background = {0.7f, 0.1f, 0.5f};
  const VarianceReport report =
      MeasureVariance(clear, clear_styled, network, neighbours, ExactWeigher(clear).get());
  EXPECT_GT(report.transparent.pairs, 1000);
  EXPECT_GT(report.largest_fraction, 0.1);
  EXPECT_LE(report.largest_fraction, 1 + 1e-4);
  const Threads single(1);
  EXPECT_EQ(PixelsOfOnePoint(source, cameras, 2000, 3, weigher.get()).size(), points.size());
}

// --- positions

// Positions of splats: as voxels' within the box, EQ(splat-position) outside of it.
TEST(FillFeatures, SplatsFarOutsideStayInReach) {
  Splats splats(3, 1);
  const Vec3f means[] = {{2, 1, -3}, {5, 1, -1}, {1e20f, 0, 1}};
  for (int i = 0; i < 3; ++i) splats.Set(i, {.mean = means[i]});
  const RadianceField field = FieldOfSplats(splats, {{}, {1, 1, -1}, {2, 1, 4}}, 0, -1);
  const Vec3f expected[] = {{0.5f, 0, -0.5f}, {1.5f, 0, 0}, {2, 0, 0}};
  for (int i = 0; i < 3; ++i) {
    float row[kFeatureStride];
    FillFeatures(field, 3, i, i, row);
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(row[27 + a], 3 * expected[i][a], 1e-5) << i;
  }
}

}  // namespace
}  // namespace regrade
