// The network's gradient by touched voxels against Algorithm 1, and the network applied to a
// field.
#include "kernels/field/background_spheres.h"
#include "kernels/field/pad_sh_basis.h"
#include "tests/support/algorithm1.h"
#include "tests/support/record_error.h"
#include "tests/support/row_of_voxels.h"
#include "tests/support/small_field.h"
#include "tests/support/styled_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

// --- the gradient

RayWeights WeightsOf(const RadianceField& field, const StyleRays& batch) {
  return ComputeRayWeights(*field.geometry,
                           {batch.rays.data(), static_cast<int64_t>(batch.rays.size())},
                           MarchOptions{}, field.near_clip);
}

TEST(Algorithm1, H46_GradientAgainstRichardson) {
  const RadianceField field = Ball(6);
  const StyleRays batch = SomeRays(2, 4);
  LipschitzNetwork network = RandomNetwork(90);
  network.data().has_base = true;
  network.data().base = SomeMap();
  ExpectRichardson(network, field, WeightsOf(field, batch), batch, -6,
                   "gradient through sigma, W, b and K");
}

void ExpectAlgorithm1(const RadianceField& field, const LipschitzNetwork& network,
                      double view_weight) {
  const StyleRays batch = SomeRays(3, 12);
  GradientAggregation aggregation(field, {.view_weight = view_weight});
  std::vector<double> gradient = NoGradient(), expected = NoGradient();
  const AggregationResult result = aggregation.Run(network, batch, &gradient);
  const double scale = 1 / (3.0 * static_cast<double>(batch.rays.size()));
  const double loss = PlainGradient(network, field, WeightsOf(field, batch), batch, scale,
                                    view_weight, &expected);
  EXPECT_NEAR(result.loss, loss, 1e-5 * loss);
  EXPECT_LE(RelativeDifference(gradient, expected),
            testing::RecordDigits("by voxels against Algorithm 1 in double",
                                  testing::Computed::kFloat,
                                  RelativeDifference(gradient, expected), 1e-5))
      << "basis " << field.appearance.basis << ", view weight " << view_weight;
  EXPECT_LT(result.touched_voxels, field.geometry->num_voxels());
  EXPECT_GT(result.touched_voxels, 0);
}

TEST(GradientAggregation, EqualsAlgorithm1) {
  for (const int basis : {9, 4, 1}) {
    LipschitzNetwork network = RandomNetwork(91);
    const RadianceField field = Ball(10, basis);
    ExpectAlgorithm1(field, network, 0);
    ExpectAlgorithm1(field, network, 0.7);
    network.data().has_base = true;
    network.data().base = SomeMap();
    ExpectAlgorithm1(field, network, 0.7);
  }
}

// The second term is no little thing beside the first, and is nothing where the network is.
TEST(GradientAggregation, ViewPenaltyIsOfTheNetworkAlone) {
  const RadianceField field = Ball(10);
  const StyleRays batch = SomeRays(3, 12);
  const auto loss = [&](const LipschitzNetwork& network, double view_weight) {
    std::vector<double> gradient = NoGradient();
    return GradientAggregation(field, {.view_weight = view_weight})
        .Run(network, batch, &gradient)
        .loss;
  };
  const LipschitzNetwork network = RandomNetwork(91), map = NetworkOfMap(SomeMap());
  EXPECT_GT(loss(network, 1), 1.01 * loss(network, 0));
  EXPECT_NEAR(loss(map, 1), loss(map, 0), 1e-9);
  EXPECT_NEAR(loss(network, 3) - loss(network, 0), 3 * (loss(network, 1) - loss(network, 0)),
              1e-9);
}

// A ball before background spheres: texels go through f as plain colours at their direction.
RadianceField BallBeforeSpheres(int n) {
  RadianceField field = Ball(n);
  AddSpheres(5, 6, 0.9, 17, &field);
  return field;
}

TEST(GradientAggregation, BackgroundSpheresAreInAlgorithm1sGradient) {
  const RadianceField field = BallBeforeSpheres(8);
  StyleRays batch = SomeRays(3, 8);
  for (size_t r = 0; r < batch.rays.size(); r += 2)  // and past the ball
    batch.rays[r].direction = Normalized(batch.rays[r].direction + Vec3f{0.4f, -0.5f, 0.6f});
  LipschitzNetwork network = RandomNetwork(97);
  network.data().has_base = true;
  network.data().base = SomeMap();
  std::vector<double> gradient = NoGradient(), expected = NoGradient(), box = NoGradient();
  const AggregationResult result =
      GradientAggregation(field, {.view_weight = 0.5}).Run(network, batch, &gradient);
  const double scale = 1 / (3.0 * static_cast<double>(batch.rays.size()));
  const double loss =
      PlainGradient(network, field, WeightsOf(field, batch), batch, scale, 0.5, &expected);
  EXPECT_NEAR(result.loss, loss, 1e-5 * loss);
  EXPECT_LE(RelativeDifference(gradient, expected),
            testing::RecordDigits("with spheres against Algorithm 1 in double",
                                  testing::Computed::kFloat,
                                  RelativeDifference(gradient, expected), 1e-5));
  // The layers contribute: the ball alone has another gradient.
  PlainGradient(network, Ball(8), WeightsOf(Ball(8), batch), batch, scale, 0.5, &box);
  EXPECT_GT(RelativeDifference(box, expected), 0.01);
}

TEST(ApplyNetwork, BackgroundTexelsGoThroughItAsPlainColours) {
  RadianceField field = BallBeforeSpheres(6);
  LipschitzNetwork network = RandomNetwork(98);
  network.data().has_base = true;
  network.data().base = SomeMap();
  const Appearance styled = ApplyNetwork(network, field);
  const SphereGeometry& spheres = field.geometry->spheres;
  const std::vector<int32_t> place = PlaceOfColumn(spheres);
  for (int64_t t = 0; t < spheres.num_texels(); t += 7) {
    const int at = place[static_cast<size_t>(t / spheres.layers)];
    const Vec3d direction = TexelDirection<double>(6, at / 6, at % 6);
    double row[kFeatureStride] = {}, out[kFeatureStride] = {};
    for (int c = 0; c < 3; ++c) {
      row[9 * c] = field.appearance.sphere_color[3 * t + c];
      row[kNetworkSh + c] = network.data().position_scale * direction[c];
    }
    network.ForwardPlain(row, out);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(styled.sphere_color[3 * t + c], out[9 * c], 1e-4);  // float's against double
  }
  // What a network that is a colour map makes of the field, the map makes of the picture.
  field.background = {0.3f, 0.5f, 0.4f};
  RadianceField mapped = field;
  mapped.appearance = ApplyNetwork(NetworkOfMap(SomeMap()), field);
  const Appearance same = ApplyColorMap(field.appearance, SomeMap());
  for (int64_t i = 0; i < same.sphere_color.size(); ++i)
    EXPECT_NEAR(mapped.appearance.sphere_color[i], same.sphere_color[i], 1e-5);
}

TEST(GradientAggregation, EveryVoxelGivesTheSameGradient) {
  const RadianceField field = Ball(10);
  const StyleRays batch = SomeRays(2, 9);
  const LipschitzNetwork network = RandomNetwork(96);
  std::vector<double> touched = NoGradient(), all = NoGradient();
  const AggregationResult some = GradientAggregation(field, {}).Run(network, batch, &touched);
  const AggregationResult every =
      GradientAggregation(field, {.every_voxel = true}).Run(network, batch, &all);
  EXPECT_LT(some.touched_voxels, field.geometry->num_voxels());
  EXPECT_EQ(every.touched_voxels, field.geometry->num_voxels());
  EXPECT_NEAR(every.loss, some.loss, 1e-12);
  EXPECT_LE(RelativeDifference(all, touched), 1e-6);
}

TEST(GradientAggregation, BatchesGiveTheSameGradient) {
  const RadianceField field = Ball(10);
  const StyleRays batch = SomeRays(2, 9);
  const LipschitzNetwork network = RandomNetwork(97);
  std::vector<double> whole = NoGradient(), parts = NoGradient();
  GradientAggregation at_once(field, {.view_weight = 0.7}),
      in_batches(field, {.view_weight = 0.7, .batch = 37});
  const AggregationResult one = at_once.Run(network, batch, &whole),
                          several = in_batches.Run(network, batch, &parts);
  EXPECT_GT(one.touched_voxels, 4 * 37);
  EXPECT_NEAR(several.loss, one.loss, 1e-12);
  EXPECT_LE(RelativeDifference(parts, whole), 1e-6);
  const StyleLoss::HiddenSums all = at_once.SumHidden(network, batch),
                              some = in_batches.SumHidden(network, batch);
  EXPECT_EQ(all.hidden, some.hidden);
  EXPECT_EQ(all.missing, some.missing);
}

// By all that the network maps, the texels of the background among it.
TEST(GradientAggregation, PaperSumDividesByPoints) {
  RadianceField field = Ball(8);
  const int64_t voxels = field.geometry->num_voxels();
  AddSpheres(2, 4, 1.0, 4, &field);
  const StyleRays batch = SomeRays(1, 8);
  const LipschitzNetwork network = RandomNetwork(92);
  GradientAggregation mean(field, {});
  GradientAggregation sum(field, {.divide_by_voxels = true});
  const double ratio = 3.0 * static_cast<double>(batch.rays.size()) /
                       static_cast<double>(voxels + field.geometry->spheres.num_texels());
  EXPECT_GT(field.geometry->spheres.num_texels(), 0);
  EXPECT_NEAR(sum.Run(network, batch, nullptr).loss / mean.Run(network, batch, nullptr).loss,
              ratio, 1e-12);
  std::vector<double> of_mean = NoGradient(), of_sum = NoGradient();
  mean.Run(network, batch, &of_mean);
  sum.Run(network, batch, &of_sum);
  for (double& value : of_mean) value *= ratio;
  EXPECT_LE(RelativeDifference(of_sum, of_mean), 1e-12);
}

TEST(GradientAggregation, H48_PatchesSumToTheWhole) {
  const RadianceField field = Ball(12);
  // More rays than a band, so that the whole is put together of bands too.
  const StyleRays batch = SomeRays(8, 48);
  const LipschitzNetwork network = RandomNetwork(93);
  GradientAggregation aggregation(field, {});
  std::vector<double> whole = NoGradient(), parts = NoGradient();
  aggregation.Run(network, batch, &whole);
  const size_t n = batch.rays.size();
  for (const size_t part : {2u, 0u, 3u, 1u}) {  // any order
    StyleRays patch;
    patch.rays.assign(batch.rays.begin() + n * part / 4,
                      batch.rays.begin() + n * (part + 1) / 4);
    patch.targets.assign(batch.targets.begin() + n * part / 4,
                         batch.targets.begin() + n * (part + 1) / 4);
    std::vector<double> gradient = NoGradient();
    aggregation.Run(network, patch, &gradient);
    for (size_t i = 0; i < parts.size(); ++i) parts[i] += gradient[i] / 4;
  }
  EXPECT_LE(RelativeDifference(parts, whole),
            testing::RecordDigits("patches against the whole", testing::Computed::kFloat,
                                  RelativeDifference(parts, whole), 1e-5));
}

TEST(GradientAggregation, ThreadsDoNotChangeABit) {
  const RadianceField field = Ball(12);
  const StyleRays batch = SomeRays(3, 20);
  const LipschitzNetwork network = RandomNetwork(94);
  std::vector<double> gradient[2] = {NoGradient(), NoGradient()};
  for (int t = 0; t < 2; ++t) {
    const Threads threads(t == 0 ? 1 : 5);
    GradientAggregation(field, {}).Run(network, batch, &gradient[t]);
  }
  EXPECT_TRUE(testing::RecordSameBits("1 and 5 threads", testing::Computed::kFloat,
                                      gradient[0] == gradient[1]));
}

TEST(GradientAggregation, H29_RaysWithoutATargetLeaveTheLoss) {
  const RadianceField field = Ball(10);
  StyleRays batch = SomeRays(2, 10), kept;
  for (size_t i = 0; i < batch.rays.size(); ++i)
    if (i % 3 == 0) {
      batch.targets[i].y = std::nanf("");
    } else {
      kept.rays.push_back(batch.rays[i]);
      kept.targets.push_back(batch.targets[i]);
    }
  const LipschitzNetwork network = RandomNetwork(95);
  GradientAggregation aggregation(field, {});
  std::vector<double> with_nan = NoGradient(), without = NoGradient();
  const AggregationResult a = aggregation.Run(network, batch, &with_nan);
  const AggregationResult b = aggregation.Run(network, kept, &without);
  EXPECT_EQ(a.rays, b.rays);
  EXPECT_EQ(a.loss, b.loss);
  EXPECT_LE(
      RelativeDifference(with_nan, without),
      testing::RecordDigits("gradient without the rays that have no target",
                            testing::Computed::kFloat, RelativeDifference(with_nan, without),
                            1e-6));  // other blocks of voxels, other rounding
}

// --- applying

TEST(ApplyNetwork, MapAloneEqualsTheLinearMap) {
  for (const int basis : {9, 4, 1}) {
    const RadianceField field = Ball(10, basis);
    const Appearance styled = ApplyNetwork(NetworkOfMap(SomeMap()), field);
    const Appearance mapped = ApplyColorMap(PadShBasis(field.appearance, 9), SomeMap());
    ASSERT_EQ(styled.basis, 9);
    ASSERT_EQ(styled.sh.size(), mapped.sh.size());
    for (int64_t i = 0; i < mapped.sh.size(); ++i) EXPECT_EQ(styled.sh[i], mapped.sh[i]);
  }
}

TEST(ApplyNetwork, EveryVoxelAsThePlainNetwork) {
  const RadianceField field = Ball(9);
  LipschitzNetwork network = RandomNetwork(96);
  network.data().has_base = true;
  network.data().base = SomeMap();
  const Appearance styled = ApplyNetwork(network, field);
  const std::vector<int32_t> vertex = VertexOfVoxel(*field.geometry);
  for (int64_t v = 0; v < field.geometry->num_voxels(); v += 17) {
    float row[kFeatureStride];
    FillFeatures(field, network.data().position_scale, v, vertex[static_cast<size_t>(v)], row);
    double x[kFeatureStride], y[kNetworkSh];
    std::copy_n(row, kFeatureStride, x);
    network.ForwardPlain(x, y);
    for (int i = 0; i < kNetworkSh; ++i)
      EXPECT_NEAR(
          styled.sh[v * 27 + i], y[i],
          testing::RecordBound("a restyled voxel against double", testing::Computed::kFloat,
                               styled.sh[v * 27 + i] - y[i], 2e-5));
  }
}

TEST(ApplyNetwork, AbortIsHeeded) {
  EXPECT_THROW(ApplyNetwork(RandomNetwork(97), Ball(8),
                            [](const Progress&) { return LoopControl::kStop; }),
               Interrupted);
}

}  // namespace
}  // namespace regrade
