// The Lipschitz network: its certificate under attack, its gradient, learning, resuming,
// applying.
#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/network/lipschitz_layer.h"
#include "stylize/algorithm1.h"
#include "stylize/apply_network.h"
#include "stylize/base_map.h"
#include "stylize/gradient_aggregation.h"
#include "stylize/initial_network.h"
#include "stylize/lipschitz_network.h"
#include "stylize/lipschitz_regularizer.h"
#include "stylize/observed_slope.h"
#include "stylize/style_rays.h"
#include "stylize/train_network.h"

namespace regrade {
namespace {

double Random(uint64_t stream, uint64_t counter) {  // uniform in [-1, 1)
  return 2 * RandomDouble(20231104, stream, counter) - 1;
}

// A ball painted in smooth colours, with some view dependence, in an N^3 grid.
RadianceField Ball(int n, int basis = 9) {
  auto geometry = std::make_shared<Geometry>();
  geometry->frame.resolution = {n, n, n};
  geometry->links.Resize(geometry->frame.NumVertices());
  std::vector<float> density, sh;
  for (int x = 0; x < n; ++x)
    for (int y = 0; y < n; ++y)
      for (int z = 0; z < n; ++z) {
        int32_t& link = geometry->links[geometry->frame.Vertex(x, y, z)];
        link = -1;
        const Vec3f p = geometry->frame.WorldOf(
            {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)});
        const float radius = Norm(p);
        if (radius > 0.75f + 4.0f / static_cast<float>(n)) continue;  // no sample at an empty corner
        link = static_cast<int32_t>(density.size());
        density.push_back(40 * (0.75f - radius));
        for (int c = 0; c < 3; ++c)
          for (int k = 0; k < basis; ++k)
            sh.push_back(k == 0
                             ? 1.5f * std::sin(3 * p.x + 2 * static_cast<float>(c)) *
                                   std::cos(4 * p.y - p.z + static_cast<float>(c))
                             : 0.1f * static_cast<float>(Random(50 + k, density.size() / 5)));
      }
  geometry->density.Resize(static_cast<int64_t>(density.size()));
  std::copy(density.begin(), density.end(), geometry->density.begin());
  RadianceField field;
  field.geometry = geometry;
  field.appearance.basis = basis;
  field.appearance.sh.Resize(static_cast<int64_t>(sh.size()));
  std::copy(sh.begin(), sh.end(), field.appearance.sh.begin());
  field.background = {0.2f, 0.3f, 0.1f};
  return field;
}

std::vector<Camera> Ring(int views, int size) {
  std::vector<Camera> cameras;
  for (int v = 0; v < views; ++v) {
    const double a = 2 * M_PI * v / views;
    const Vec3d center{2.2 * std::cos(a), 2.2 * std::sin(a), 0.4 * std::sin(2 * a)};
    const Vec3d forward = Normalized(-center);
    const Vec3d right = Normalized(Cross(forward, Vec3d{0, 0, 1}));
    Camera camera;
    camera.width = camera.height = size;
    camera.fx = camera.fy = 1.3 * size;
    camera.cx = camera.cy = 0.5 * size;
    camera.camera_from_world.rotation.row[0] = right;
    camera.camera_from_world.rotation.row[1] = Cross(forward, right);
    camera.camera_from_world.rotation.row[2] = forward;
    camera.camera_from_world.translation = -(camera.camera_from_world.rotation * center);
    cameras.push_back(camera);
  }
  return cameras;
}

// What a network makes of the field, seen along rays: rendering without a renderer.
std::vector<Vec3f> Render(const RadianceField& field, const std::vector<Ray>& rays) {
  const RayWeights weights = ComputeRayWeights(
      *field.geometry, {rays.data(), static_cast<int64_t>(rays.size())}, MarchOptions{}, 0);
  std::vector<Vec3f> colors;
  const int basis = field.appearance.basis, stride = 3 * basis;
  for (size_t r = 0; r < rays.size(); ++r) {
    float gamma[kMaxBasis], sh[3 * kMaxBasis];
    ShBasis(basis, rays[r].direction, gamma);
    Vec3f color = field.background * weights.transmittance[r];
    for (int64_t i = weights.first[r]; i < weights.first[r + 1]; ++i) {
      const WeightedSample& sample = weights.samples[static_cast<size_t>(i)];
      Interpolate(field.geometry->frame, field.geometry->links.data(),
                  field.appearance.sh.data(), stride, stride,
                  Cell<float>{sample.vertex, sample.fraction}, sh);
      for (int c = 0; c < 3; ++c) {
        float value = 0.5f;
        for (int k = 0; k < basis; ++k) value += sh[c * basis + k] * gamma[k];
        color[c] += sample.weight * std::max(value, 0.0f);
      }
    }
    colors.push_back(color);
  }
  return colors;
}

// The ball's views, each colour sent through a style.
struct StyledBall {
  RadianceField field;
  std::vector<Image> targets, masks;  // a mask leaves out what the background shines through
  std::vector<StyledTrainingView> views;

  template <typename Style>
  StyledBall(int voxels, int num_views, int size, const Style& style) : field(Ball(voxels)) {
    const std::vector<Camera> cameras = Ring(num_views, size);
    targets.assign(cameras.size(), Image(size, size));
    masks.assign(cameras.size(), Image(size, size, 1));
    for (size_t v = 0; v < cameras.size(); ++v) {
      std::vector<Ray> rays;
      for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x) rays.push_back(cameras[v].PixelRay(x, y));
      const std::vector<Vec3f> colors = Render(field, rays);
      for (size_t i = 0; i < rays.size(); ++i) {
        const Vec3f styled = style(colors[i]);
        std::copy_n(&styled.x, 3, &targets[v].pixels[i * 3]);
        const RayWeights weights =
            ComputeRayWeights(*field.geometry, {&rays[i], 1}, MarchOptions{}, 0);
        masks[v].pixels[i] = weights.transmittance[0] < 0.01f ? 1.0f : 0.0f;
      }
      views.push_back({cameras[v], &targets[v], &masks[v], "view " + std::to_string(v)});
    }
  }
};

Vec3f LinearStyle(const Vec3f& c) {
  return {0.1f + 0.7f * c.x + 0.1f * c.y, 0.8f * c.y + 0.05f, 0.2f + 0.5f * c.z + 0.1f * c.x};
}

Vec3f CurvedStyle(const Vec3f& c) {
  const float luma = 0.3f * c.x + 0.6f * c.y + 0.1f * c.z;
  const float s = 4 * (luma - 0.5f) * (luma - 0.5f);  // shadows and lights alike
  return {0.2f + 0.3f * c.x + 0.4f * s, 0.3f * c.y + 0.5f * s, 0.5f + 0.3f * c.z - 0.4f * s};
}

LipschitzNetwork RandomNetwork(uint64_t stream, double k = 1.3) {
  LipschitzNetwork network;
  for (size_t i = 0; i < network.data().parameters.size(); ++i)
    network.data().parameters[i] = static_cast<float>(0.3 * Random(stream, i));
  for (int l = 0; l < kNetworkLayers; ++l) network.k(l) = static_cast<float>(k);
  network.data().sh_scale = 1.4f;
  network.WarmUpNorms();
  return network;
}

ColorMap SomeMap() {
  ColorMap map;
  map.matrix.row[0] = {1.2, -0.1, 0.2};
  map.matrix.row[1] = {0.0, 0.8, 0.1};
  map.matrix.row[2] = {-0.3, 0.1, 0.9};
  map.offset = {0.05, -0.1, 0.1};
  return map;
}

StyleRays SomeRays(int views, int size) {
  StyleRays batch;
  for (const Camera& camera : Ring(views, size))
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x) {
        batch.rays.push_back(camera.PixelRay(x, y));
        const uint64_t i = batch.rays.size();
        batch.targets.push_back({static_cast<float>(0.5 + 0.5 * Random(60, i)),
                                 static_cast<float>(0.5 + 0.5 * Random(61, i)),
                                 static_cast<float>(0.5 + 0.5 * Random(62, i))});
      }
  return batch;
}

struct Threads {
  explicit Threads(int n) : before(omp_get_max_threads()) { omp_set_num_threads(n); }
  ~Threads() { omp_set_num_threads(before); }
  int before;
};

// --- the certificate

// 1e5 pairs of arbitrary points, near and far, against EQ(liprf-bound).
double SteepestPair(const LipschitzNetwork& network, int pairs) {
  const DenseNetwork<double> f = network.Effective<double>();
  double steepest = 0;
  for (int i = 0; i < pairs; ++i) {
    double x[kFeatureStride] = {}, y[kFeatureStride] = {}, fx[kNetworkSh], fy[kNetworkSh];
    const double reach = std::pow(10.0, -3 + 3 * (i % 7) / 6.0);
    double distance = 0;
    for (int k = 0; k < kNetworkInputs; ++k) {
      x[k] = 2 * Random(70, static_cast<uint64_t>(i) * 64 + k);
      y[k] = x[k] + reach * Random(71, static_cast<uint64_t>(i) * 64 + k);
      distance += (x[k] - y[k]) * (x[k] - y[k]);
    }
    DenseForward(f, x, fx);
    DenseForward(f, y, fy);
    if (network.data().has_base) {
      AddBaseMap(network.data().base, x, fx);
      AddBaseMap(network.data().base, y, fy);
    }
    double change = 0;
    for (int k = 0; k < kNetworkSh; ++k) change += (fx[k] - fy[k]) * (fx[k] - fy[k]);
    steepest = std::max(steepest, std::sqrt(change / distance));
  }
  return steepest;
}

TEST(LipschitzNetwork, H36_NoPairIsSteeperThanTheBound) {
  for (const char* activation : {"sine", "relu", "leaky-relu", "sigmoid", "tanh"}) {
    LipschitzNetwork network = RandomNetwork(80);
    network.data().activation = activation;
    network.data().has_base = true;
    network.data().base = SomeMap();
    EXPECT_LE(SteepestPair(network, 4000), network.Bound()) << activation;
  }
}

TEST(LipschitzNetwork, H36_SineUnderManyArbitraryPairs) {
  const LipschitzNetwork network = RandomNetwork(81);
  const double steepest = SteepestPair(network, 20000);
  EXPECT_LE(steepest, network.Bound());
  EXPECT_GT(steepest, 0.02 * network.Bound());  // the attack is not idle
}

TEST(LipschitzNetwork, H36_StaleNormsAreNotBelieved) {
  // Every layer K W / sigma_hat with W = diag(1, 1/2, ...) and sigma_hat measured along the
  // second axis: twice too small, so each layer's norm is 2 K. A linear network shows it.
  LipschitzNetwork network;
  network.data().activation = "leaky-relu";
  network.data().singular_vectors.assign(network.data().singular_vectors.size(), 0.0f);
  float* vectors = network.data().singular_vectors.data();
  for (int l = 0; l < kNetworkLayers; ++l) {
    const int inputs = LipschitzNetwork::Inputs(l);
    network.weight(l)[0] = 1;
    network.weight(l)[inputs + 1] = 0.5f;
    network.k(l) = 1;
    vectors[1] = 1;
    vectors[LipschitzNetwork::Outputs(l) + 1] = 1;
    vectors += LipschitzNetwork::Outputs(l) + inputs;
  }
  EXPECT_NEAR(network.Bound(), 64, 1e-3);
  double x[kFeatureStride] = {1}, y[kNetworkSh];
  network.ForwardPlain(x, y);
  EXPECT_NEAR(y[0], 64, 1e-3);  // and f really is that steep; the declared product is 1
  EXPECT_NEAR(network.NormDrift(), 1, 1e-6);
  network.WarmUpNorms();
  EXPECT_NEAR(network.Bound(), 1, 1e-3);
}

TEST(LipschitzNetwork, H44_OmegaMultipliesTheBoundOnceALayer) {
  LipschitzNetwork network = RandomNetwork(82);
  const double bound = network.Bound();
  network.data().omega = 2;
  EXPECT_NEAR(network.Bound() / bound, 32, 1e-9);
  EXPECT_LE(SteepestPair(network, 2000), network.Bound());
}

TEST(LipschitzNetwork, BaseMapCountsWithItsNorm) {
  const LipschitzNetwork network = NetworkOfMap(SomeMap());
  EXPECT_EQ(network.ResidualBound(), 0);
  EXPECT_NEAR(network.Bound(), SpectralNorm(SomeMap().matrix), 1e-12);
  const ObservedSlopes slopes =
      ObserveSlopes(network, Ball(12), {.pairs = 2000, .jacobians = 5});
  EXPECT_LE(slopes.pairs, network.Bound() * (1 + 1e-12));
  EXPECT_NEAR(slopes.jacobians, network.Bound(), 1e-4);  // thirty steps of the power iteration
}

TEST(ObservedSlope, H36_ClimbingStaysBelowTheBound) {
  LipschitzNetwork network = RandomNetwork(83);
  network.data().has_base = true;
  network.data().base = SomeMap();
  const ObservedSlopes slopes =
      ObserveSlopes(network, Ball(12), {.pairs = 100000, .jacobians = 100});
  EXPECT_GT(slopes.pairs, 0);
  EXPECT_GE(slopes.jacobians, 0.5 * slopes.pairs);
  EXPECT_GE(slopes.ascent, slopes.jacobians);
  EXPECT_LE(slopes.ascent, network.Bound());
  EXPECT_LE(slopes.pairs, network.Bound());
}

TEST(LipschitzNetwork, RefusesWhatIsNoNetwork) {
  LipschitzNetworkData data = RandomNetwork(84).data();
  EXPECT_NO_THROW(LipschitzNetwork{data});
  for (int defect = 0; defect < 4; ++defect) {
    LipschitzNetworkData bad = data;
    if (defect == 0) bad.parameters.pop_back();
    if (defect == 1) bad.singular_vectors.clear();
    if (defect == 2) bad.parameters[100] = std::numeric_limits<float>::quiet_NaN();
    if (defect == 3) bad.activation = "swish";
    EXPECT_THROW(LipschitzNetwork{bad}, Error) << defect;
  }
}

// --- the regularisation

TEST(LipschitzRegularizer, H20_H21_H22_Targets) {
  EXPECT_EQ(LayerTarget(0, 6), 0);
  EXPECT_NEAR(std::pow(LayerTarget(2.87, 6), 6), 2.87, 1e-14 * 2.87 * 6);
  bool capped = false;
  EXPECT_NEAR(LayerTarget(1e7, 6, &capped), std::pow(1e3, 1.0 / 6), 1e-12);
  EXPECT_TRUE(capped);
  LayerTarget(5, 6, &capped);
  EXPECT_FALSE(capped);
  EXPECT_THROW(LayerTarget(std::numeric_limits<double>::infinity(), 6), Error);
  EXPECT_THROW(LayerTarget(std::nan(""), 6), Error);
}

TEST(LipschitzRegularizer, H35_AlwaysPullsTheRightWay) {
  for (const float k : {0.0f, 0.5f, 1.0f, 1.19f, 1.2f, 3.0f}) {
    EXPECT_GT(LipschitzPenalty(k, 1.2), 0);
    EXPECT_GT(LipschitzPenaltyDerivative(k, 1.2), 0);
  }
  EXPECT_NEAR(LipschitzPenaltyDerivative(3.0, 1.2), 1, 1e-9);
  EXPECT_LT(LipschitzPenaltyDerivative(0.5, 1.2), 1e-9);
}

// --- the gradient

// Algorithm 1's loss and its gradient by the network's own parameters.
double PlainGradient(const LipschitzNetwork& network, const RadianceField& field,
                     const StyleRays& batch, double scale, std::vector<double>* gradient) {
  const RayWeights weights = ComputeRayWeights(
      *field.geometry, {batch.rays.data(), static_cast<int64_t>(batch.rays.size())},
      MarchOptions{}, field.near_clip);
  std::vector<Vec3d> directions, targets;
  for (size_t r = 0; r < batch.rays.size(); ++r) {
    directions.push_back(batch.rays[r].direction.Cast<double>());
    targets.push_back(batch.targets[r].Cast<double>());
  }
  DenseNetwork<double> d_effective;
  for (int l = 0; l < kNetworkLayers; ++l)
    d_effective.layers.emplace_back(LipschitzNetwork::Outputs(l), LipschitzNetwork::Inputs(l));
  const double loss =
      Algorithm1<double>(network, field, weights, directions, targets, scale, &d_effective);
  if (gradient != nullptr) network.AddGradient(d_effective, gradient);
  return loss;
}

double RelativeDifference(const std::vector<double>& a, const std::vector<double>& b) {
  double difference = 0, norm = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    difference += (a[i] - b[i]) * (a[i] - b[i]);
    norm += b[i] * b[i];
  }
  return std::sqrt(difference / norm);
}

std::vector<double> NoGradient() {
  return std::vector<double>(static_cast<size_t>(LipschitzNetwork::NumParameters()));
}

TEST(Algorithm1, H46_GradientAgainstRichardson) {
  const RadianceField field = Ball(6);
  const StyleRays batch = SomeRays(2, 4);
  LipschitzNetwork network = RandomNetwork(90);
  network.data().has_base = true;
  network.data().base = SomeMap();
  std::vector<double> gradient = NoGradient();
  PlainGradient(network, field, batch, 1.0, &gradient);
  // Parameters are float: steps are powers of two, so that both ends are exact. Every layer's
  // W, b and K; u and v stay, as in the adjoint.
  for (int l = 0; l < kNetworkLayers; ++l) {
    const int64_t first = network.weight(l) - network.weight(0);
    const int64_t bias = network.bias(l) - network.weight(0);
    const int64_t k = &network.k(l) - network.weight(0);
    for (const int64_t at : {first, first + 37, bias + 3, k}) {
      float& value = network.data().parameters[static_cast<size_t>(at)];
      const float before = value = std::ldexp(std::round(std::ldexp(value, 14)), -14);
      std::vector<double> analytic = NoGradient();
      PlainGradient(network, field, batch, 1.0, &analytic);
      const auto central = [&](float h) {
        value = before + h;
        const double plus = PlainGradient(network, field, batch, 1.0, nullptr);
        value = before - h;
        const double minus = PlainGradient(network, field, batch, 1.0, nullptr);
        value = before;
        return (plus - minus) / (2 * static_cast<double>(h));
      };
      // Two Richardson steps: error O(h^6).
      const double h0 = central(0x1p-6f), h1 = central(0x1p-7f), h2 = central(0x1p-8f);
      const double r0 = (4 * h1 - h0) / 3, r1 = (4 * h2 - h1) / 3;
      const double numeric = (16 * r1 - r0) / 15;
      EXPECT_NEAR(analytic[static_cast<size_t>(at)], numeric,
                  2e-8 * std::max(1.0, std::abs(numeric)))
          << "layer " << l << " parameter " << at - first;
    }
  }
}

TEST(GradientAggregation, EqualsAlgorithm1) {
  for (const int basis : {9, 4, 1}) {
    const RadianceField field = Ball(10, basis);
    const StyleRays batch = SomeRays(3, 12);
    LipschitzNetwork network = RandomNetwork(91);
    network.data().has_base = true;
    network.data().base = SomeMap();
    GradientAggregation aggregation(field, {});
    std::vector<double> gradient = NoGradient(), expected = NoGradient();
    const AggregationResult result = aggregation.Run(network, batch, &gradient);
    const double scale = 1 / (3.0 * static_cast<double>(batch.rays.size()));
    const double loss = PlainGradient(network, field, batch, scale, &expected);
    EXPECT_NEAR(result.loss, loss, 1e-5 * loss);
    EXPECT_LE(RelativeDifference(gradient, expected), 1e-5) << "basis " << basis;
    EXPECT_LT(result.touched_voxels, field.geometry->num_voxels());
    EXPECT_GT(result.touched_voxels, 0);
  }
}

TEST(GradientAggregation, PaperSumDividesByVoxels) {
  const RadianceField field = Ball(8);
  const StyleRays batch = SomeRays(1, 8);
  const LipschitzNetwork network = RandomNetwork(92);
  GradientAggregation mean(field, {});
  GradientAggregation sum(field, {.divide_by_voxels = true});
  const double ratio = 3.0 * static_cast<double>(batch.rays.size()) /
                       static_cast<double>(field.geometry->num_voxels());
  EXPECT_NEAR(sum.Run(network, batch, nullptr).loss / mean.Run(network, batch, nullptr).loss,
              ratio, 1e-12);
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
  EXPECT_LE(RelativeDifference(parts, whole), 1e-5);
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
  EXPECT_EQ(gradient[0], gradient[1]);
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
  EXPECT_LE(RelativeDifference(with_nan, without),
            1e-6);  // other blocks of voxels, other rounding
}

// --- applying

TEST(ApplyNetwork, MapAloneEqualsTheLinearMap) {
  for (const int basis : {9, 4, 1}) {
    const RadianceField field = Ball(10, basis);
    const Appearance styled = ApplyNetwork(NetworkOfMap(SomeMap()), field);
    const Appearance mapped = ApplyColorMap(field.appearance, SomeMap());
    ASSERT_EQ(styled.basis, basis);
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
    for (int i = 0; i < kNetworkSh; ++i) EXPECT_NEAR(styled.sh[v * 27 + i], y[i], 2e-5);
  }
}

TEST(ApplyNetwork, AbortIsHeeded) {
  EXPECT_THROW(
      ApplyNetwork(RandomNetwork(97), Ball(8), [](const Progress&) { return Verdict::kAbort; }),
      Interrupted);
}

// --- learning

TrainNetworkOptions Quick(int steps) {
  TrainNetworkOptions options;
  options.steps = steps;
  options.rays_per_step = 512;
  return options;
}

SceneColorMap MapOf(const StyledBall& ball) {
  // The scene-wide map's part is played by least squares over all pixels; K_est is its norm.
  StyleRays all;
  for (const auto& view : ball.views)
    for (int y = 0; y < view.camera.height; ++y)
      for (int x = 0; x < view.camera.width; ++x) {
        const float* t = view.target->at(x, y);
        all.rays.push_back(view.camera.PixelRay(x, y));
        all.targets.push_back({t[0], t[1], t[2]});
        if (*view.mask->at(x, y) < 0.5f) all.targets.back().x = std::nanf("");
      }
  SceneColorMap result;
  result.map = LeastSquaresMap(ball.field, all, {.max_transmittance = 0.5f});
  result.k_est = SpectralNorm(result.map.matrix);
  return result;
}

TEST(LeastSquaresMap, RecoversALinearStyle) {
  // Rendered targets of the mapped field: the map itself is the answer.
  RadianceField field = Ball(14);
  for (int64_t i = 0; i < field.appearance.sh.size(); ++i)
    field.appearance.sh[i] *= 0.4f;  // no clamps
  StyleRays batch = SomeRays(3, 16);
  RadianceField mapped = field;
  ColorMap map = SomeMap();
  map.offset = {0.1, 0.1, 0.2};
  mapped.appearance = ApplyColorMap(field.appearance, map);
  batch.targets = Render(mapped, batch.rays);
  const ColorMap found = LeastSquaresMap(field, batch, {});
  for (int c = 0; c < 3; ++c) {
    for (int d = 0; d < 3; ++d) EXPECT_NEAR(found.matrix(c, d), map.matrix(c, d), 1e-4);
    EXPECT_NEAR(found.offset[c], map.offset[c], 1e-4);
  }
}

TEST(TrainNetwork, BeatsTheLinearMapWhereTheStyleIsCurved) {
  const StyledBall ball(20, 6, 40, CurvedStyle);
  const TrainNetworkResult result =
      TrainNetwork(ball.field, ball.views, MapOf(ball), {}, Quick(120), {});
  EXPECT_GT(result.psnr_db, result.linear_map_psnr_db + 3);
  EXPECT_LE(result.bound, 4 * result.k_est * (1 + 1e-9));
  EXPECT_LE(result.slope_observed, result.bound);
  EXPECT_LE(result.slope_observed, 1.5 * result.k_est);
  EXPECT_NEAR(result.bound, result.network.Bound(), 1e-12);
  EXPECT_LE(result.largest_norm_drift, 0.01);  // H38
  EXPECT_GT(result.smallest_k, 0.01);          // H34
}

TEST(TrainNetwork, NeverLosesToTheLinearMap) {
  const StyledBall ball(16, 4, 32, LinearStyle);
  const TrainNetworkResult result =
      TrainNetwork(ball.field, ball.views, MapOf(ball), {}, Quick(30), {});
  EXPECT_GE(result.psnr_db, result.linear_map_psnr_db);
}

TEST(TrainNetwork, BoundIsKeptHoweverSmall) {
  const StyledBall ball(16, 4, 32, CurvedStyle);
  TrainNetworkOptions options = Quick(40);
  options.bound_factor = 1.3;
  const SceneColorMap map = MapOf(ball);
  const TrainNetworkResult result = TrainNetwork(ball.field, ball.views, map, {}, options, {});
  EXPECT_LE(result.bound, 1.3 * map.k_est * (1 + 1e-9));
  EXPECT_GT(result.bound, result.network.BaseNorm());
}

TEST(TrainNetwork, PaperRecipe) {
  TrainNetworkOptions options;
  options.seed = 5;
  ApplyStyleRecipe("paper", &options);
  EXPECT_EQ(options.steps, 300);
  EXPECT_EQ(options.rate_first, 1e-2);
  EXPECT_EQ(options.rate_last, 1e-4);
  EXPECT_EQ(options.lambda, 2e-4);
  EXPECT_EQ(options.rays_per_step, 0);
  EXPECT_EQ(options.base, "none");
  EXPECT_EQ(options.norm_steps, 1);
  EXPECT_EQ(options.seed, 5u);
  EXPECT_THROW(ApplyStyleRecipe("fast", &options), Error);

  const StyledBall ball(12, 3, 24, CurvedStyle);
  options.steps = 60;
  const TrainNetworkResult result =
      TrainNetwork(ball.field, ball.views, MapOf(ball), {}, options, {});
  EXPECT_FALSE(result.network.data().has_base);
  EXPECT_EQ(result.linear_map_psnr_db, 0);
  EXPECT_GT(result.psnr_db, 15);
  EXPECT_LE(result.slope_observed, result.bound);
}

TEST(TrainNetwork, PyTorchStartHasItsWeightsNorms) {
  LipschitzNetwork network;
  InitializeAsPyTorch(3, &network);
  const DenseNetwork<double> f = network.Effective<double>();
  for (int l = 0; l < kNetworkLayers; ++l)
    for (const int i : {0, 5, 900})
      EXPECT_NEAR(f.layers[static_cast<size_t>(l)].weight[static_cast<size_t>(i)],
                  network.weight(l)[i], 1e-6);
}

TEST(TrainNetwork, Ablations) {
  const StyledBall ball(12, 3, 24, CurvedStyle);
  const SceneColorMap map = MapOf(ball);
  TrainNetworkOptions options;
  ApplyStyleRecipe("paper", &options);
  options.steps = 40;
  options.rays_per_step = 512;
  const auto bound = [&](const TrainNetworkOptions& o) {
    return TrainNetwork(ball.field, ball.views, map, {}, o, {}).bound;
  };
  TrainNetworkOptions spectral = options;
  spectral.spectral_normalisation = true;
  EXPECT_NEAR(bound(spectral), 1, 0.02);  // the warm-up's sigma is within 1e-6, products of six
  TrainNetworkOptions free = options, tight = options;
  options.lambda = free.lambda = tight.lambda = 0.05;
  free.no_regularisation = true;
  tight.no_k_est = true;
  EXPECT_GT(bound(free), bound(options));
  EXPECT_GT(bound(options), bound(tight));
}

TEST(TrainNetwork, H109_H110_ResumeAndThreadsAreBitwise) {
  const StyledBall ball(14, 4, 32, CurvedStyle);
  const SceneColorMap map = MapOf(ball);
  const TrainNetworkOptions options = Quick(30);
  TrainingState half;
  TrainingHooks hooks;
  hooks.checkpoint_every = 15;
  hooks.checkpoint = [&](const TrainingState& state) {
    if (state.step == 15) half = state;
  };
  const TrainNetworkResult straight =
      TrainNetwork(ball.field, ball.views, map, {}, options, hooks);
  ASSERT_EQ(half.step, 15);
  const Threads threads(3);
  const TrainNetworkResult resumed =
      TrainNetwork(ball.field, ball.views, map, {}, options, {}, &half);
  EXPECT_EQ(straight.network.data().parameters, resumed.network.data().parameters);
  EXPECT_EQ(straight.network.data().singular_vectors, resumed.network.data().singular_vectors);
  EXPECT_EQ(straight.bound, resumed.bound);
  EXPECT_EQ(straight.psnr_db, resumed.psnr_db);
}

TEST(TrainNetwork, H109_RaysAreAFunctionOfSeedAndStep) {
  StyledBall ball(8, 3, 24, LinearStyle);
  for (auto& view : ball.views) view.mask = nullptr;
  const StyleRays a = SampleStyleRays(ball.views, 256, 8, 7, 3);
  const StyleRays b = SampleStyleRays(ball.views, 256, 8, 7, 3);
  const StyleRays c = SampleStyleRays(ball.views, 256, 8, 7, 4);
  EXPECT_EQ(a.rays.size(), 256u);
  EXPECT_TRUE(a.targets == b.targets);
  EXPECT_FALSE(a.targets == c.targets);
  EXPECT_EQ(SampleStyleRays(ball.views, 0, 8, 7, 3).rays.size(), 24u * 24u);
}

TEST(TrainNetwork, H106_StopsAtTheSecondStepThatIsNotFinite) {
  const StyledBall ball(10, 3, 24, LinearStyle);
  const SceneColorMap map = MapOf(ball);
  TrainingState state;
  TrainingHooks hooks;
  hooks.checkpoint_every = 5;
  hooks.checkpoint = [&](const TrainingState& s) { state = s; };
  TrainNetwork(ball.field, ball.views, map, {}, Quick(5), hooks);
  // A bias so large that the network's output overflows: finite itself, but no gradient is.
  LipschitzNetwork broken(state.network);
  broken.bias(5)[0] = 3e38f;
  state.network = broken.data();
  const TrainingState before = state;
  try {
    TrainNetwork(ball.field, ball.views, map, {}, Quick(20), hooks, &before);
    FAIL() << "learning went on";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kScene);
    EXPECT_NE(std::string(error.what()).find("step 6"), std::string::npos) << error.what();
  }
  EXPECT_EQ(state.adam.rejected, 2);
  EXPECT_EQ(state.network.parameters, before.network.parameters);  // no step was taken
}

TEST(TrainNetwork, H29_PixelsThatAreNotFinite) {
  StyledBall ball(10, 3, 24, LinearStyle);
  const SceneColorMap map = MapOf(ball);
  for (auto& view : ball.views) view.mask = nullptr;
  ball.targets[1].pixels[5] = std::nanf("");
  const TrainNetworkResult result = TrainNetwork(ball.field, ball.views, map, {}, Quick(5), {});
  EXPECT_EQ(result.left_out_pixels, 1);
  EXPECT_TRUE(std::isfinite(result.psnr_db));
  for (int i = 0; i < 30; ++i)
    ball.targets[1].pixels[static_cast<size_t>(i) * 3] = std::nanf("");
  try {
    TrainNetwork(ball.field, ball.views, map, {}, Quick(5), {});
    FAIL() << "30 of 576 pixels were accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.where(), "view 1");
  }
  ball.targets[1] = Image(20, 24);
  EXPECT_THROW(TrainNetwork(ball.field, ball.views, map, {}, Quick(5), {}), Error);
}

TEST(TrainNetwork, MaskedPixelsDoNotTeach) {
  StyledBall ball(10, 3, 24, LinearStyle);
  const SceneColorMap map = MapOf(ball);
  std::vector<float> learned[2];
  Image mask(24, 24, 1);
  for (size_t i = 0; i < mask.pixels.size(); ++i) mask.pixels[i] = i % 24 < 12 ? 1.0f : 0.0f;
  for (auto& view : ball.views) view.mask = &mask;
  for (int run = 0; run < 2; ++run) {
    if (run == 1)
      for (Image& target : ball.targets)
        for (size_t i = 0; i < mask.pixels.size(); ++i)
          if (mask.pixels[i] == 0) target.pixels[i * 3] = 0.9f;
    learned[run] =
        TrainNetwork(ball.field, ball.views, map, {}, Quick(5), {}).network.data().parameters;
  }
  EXPECT_EQ(learned[0], learned[1]);
}

TEST(TrainNetwork, H20_ConstantStyleRunsToCompletion) {
  const StyledBall ball(10, 3, 24, [](const Vec3f&) { return Vec3f{0.4f, 0.5f, 0.6f}; });
  SceneColorMap map;
  map.map.matrix = Mat3d{};
  for (auto& row : map.map.matrix.row) row = {0, 0, 0};
  map.map.offset = {0.4, 0.5, 0.6};
  map.k_est = 0;
  const TrainNetworkResult result =
      TrainNetwork(ball.field, ball.views, map, {}, Quick(10), {});
  EXPECT_TRUE(std::isfinite(result.bound));
  EXPECT_GT(result.psnr_db, 40);
}

TEST(TrainNetwork, FinishKeepsAUsableResultAndAbortLeaves) {
  const StyledBall ball(10, 3, 24, CurvedStyle);
  const SceneColorMap map = MapOf(ball);
  TrainingHooks hooks;
  hooks.progress = [](const Progress& p) {
    return p.done >= 7 ? Verdict::kFinish : Verdict::kContinue;
  };
  EXPECT_EQ(TrainNetwork(ball.field, ball.views, map, {}, Quick(20), hooks).steps, 7);
  int64_t saved = 0;
  hooks.progress = [](const Progress& p) {
    return p.done >= 3 ? Verdict::kAbort : Verdict::kContinue;
  };
  hooks.checkpoint = [&](const TrainingState& state) { saved = state.step; };
  EXPECT_THROW(TrainNetwork(ball.field, ball.views, map, {}, Quick(20), hooks), Interrupted);
  EXPECT_EQ(saved, 3);
}

}  // namespace
}  // namespace regrade
