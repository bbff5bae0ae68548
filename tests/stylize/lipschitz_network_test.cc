// The Lipschitz network: its certificate under attack, its regularisation.
#include <algorithm>
#include <cstdlib>

#include "kernels/base/half.h"
#include "tests/support/record_error.h"
#include "tests/support/row_of_voxels.h"
#include "tests/support/small_field.h"
#include "tests/support/steepest_pair.h"
#include "tests/support/styled_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

// --- the certificate

TEST(LipschitzNetwork, H36_NoPairIsSteeperThanTheBound) {
  for (const int basis : {9, 16})
    for (const char* activation : {"sine", "relu", "leaky-relu", "sigmoid", "tanh"}) {
      LipschitzNetwork network = RandomNetwork(80, 1.3, basis);
      network.data().activation = activation;
      network.data().has_base = true;
      network.data().base = SomeMap();
      const double steepest = SteepestPair(network, 4000);
      EXPECT_LE(steepest, network.Bound() * testing::RecordBound(
                                                "steepest of 10 x 4 000 pairs over the bound",
                                                testing::Computed::kDouble,
                                                steepest / network.Bound(), 1))
          << activation << " " << basis;
    }
}

// REGRADE_PAIRS=1000000 attacks more networks, each with 20 000 pairs, than the usual one.
TEST(LipschitzNetwork, H36_SineUnderManyArbitraryPairs) {
  constexpr int kPairs = 20000;
  const char* wanted = std::getenv("REGRADE_PAIRS");
  const int networks = std::max(1, (wanted ? std::atoi(wanted) : 0) / kPairs);
  double steepest = 0;
  for (int n = 0; n < networks; ++n) {
    const LipschitzNetwork network = RandomNetwork(81 + 1000 * static_cast<uint64_t>(n));
    const double fraction = SteepestPair(network, kPairs) / network.Bound();
    EXPECT_LE(fraction, RecordBound("steepest of 20 000 pairs over the bound",
                                    Computed::kDouble, fraction, 1));
    steepest = std::max(steepest, fraction);
  }
  EXPECT_GT(steepest, 0.02);  // the attack is not idle
}

// What follows from the bound; see EQ(liprf-bound): coefficients stored as halves, styles mixed
// with the scene, and objects, whose voxels have weights of their own.
TEST(LipschitzNetwork, H36_HalvesMixesAndObjectsFollowFromTheBound) {
  LipschitzNetwork network = RandomNetwork(80);
  network.data().has_base = true;
  network.data().base = SomeMap();
  const double bound = network.Bound();
  constexpr double kHalf = 0x1p-11, kSmallest = 0x1p-25;  // relative, and of subnormal halves
  struct Sums {
    double squares = 0;
    void Add(double v) { squares += v * v; }
    double norm() const { return std::sqrt(squares); }
  };
  ForRandomPairs(
      network, 4000,
      [&](const double* x, const double* y, const double* fx, const double* fy,
          double distance) {
        Sums stored, styled_x, styled_y, mixed, object, apart;
        const double own = RandomDouble(1, 72, static_cast<uint64_t>(1e9 * distance)),
                     other = 1 - own * own;
        for (int k = 0; k < kNetworkSh; ++k) {
          const auto half = [](double v) {
            return double{FloatFromHalf(HalfFromFloat(static_cast<float>(v)))};
          };
          stored.Add(half(fx[k]) - half(fy[k]));
          styled_x.Add(fx[k]);
          styled_y.Add(fy[k]);
          const auto blend = [k](const double* from, const double* to, double weight) {
            return from[k] + weight * (to[k] - from[k]);
          };
          mixed.Add(blend(x, fx, own) - blend(y, fy, own));
          object.Add(blend(x, fx, own) - blend(y, fy, other));
          apart.Add(fy[k] - y[k]);
        }
        // Float rounding before the half adds 2^-24 of a value, within the rounding of kHalf's.
        const double rounding = (kHalf + 0x1p-23) * (styled_x.norm() + styled_y.norm()) +
                                2 * std::sqrt(27.0) * kSmallest;
        ASSERT_LE(stored.norm(), bound * distance + rounding);
        const double of_mix = 1 - own + own * bound;
        ASSERT_LE(mixed.norm(), of_mix * distance * (1 + 1e-12));
        ASSERT_LE(object.norm(), of_mix * distance * (1 + 1e-12) +
                                     std::abs(own - other) * apart.norm() + 1e-12);
      });
}

TEST(LipschitzNetwork, H36_StaleNormsAreNotBelieved) {
  // Every layer K W / sigma_hat with W = diag(1, 1/2, ...) and sigma_hat measured along the
  // second axis: twice too small, so each layer's norm is 2 K. A linear network shows it.
  LipschitzNetwork network;
  network.data().activation = "leaky-relu";
  network.data().singular_vectors.assign(network.data().singular_vectors.size(), 0.0f);
  float* vectors = network.data().singular_vectors.data();
  for (int l = 0; l < kNetworkLayers; ++l) {
    const int inputs = network.Inputs(l);
    network.weight(l)[0] = 1;
    network.weight(l)[inputs + 1] = 0.5f;
    network.k(l) = 1;
    vectors[1] = 1;
    vectors[network.Outputs(l) + 1] = 1;
    vectors += network.Outputs(l) + inputs;
  }
  EXPECT_NEAR(network.Bound(), 64,
              testing::RecordDigits("bound with stale norms", testing::Computed::kDouble,
                                    network.Bound() - 64, 1.5e-5, 64));
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
  EXPECT_NEAR(network.Bound() / bound, 32,
              testing::RecordDigits("bound at omega 2 over omega 1", testing::Computed::kDouble,
                                    network.Bound() / bound - 32, 3e-11, 32));
  EXPECT_LE(SteepestPair(network, 2000), network.Bound());
}

TEST(LipschitzNetwork, BaseMapCountsWithItsNorm) {
  const LipschitzNetwork network = NetworkOfMap(SomeMap());
  EXPECT_EQ(network.LearnedBound(), 0);
  EXPECT_NEAR(network.Bound(), SpectralNorm(SomeMap().matrix), 1e-12);
  const LocalLipschitz slopes =
      MeasureLocalLipschitz(network, Ball(12), {.pairs = 2000, .jacobians = 5});
  EXPECT_LE(slopes.pairs, network.Bound() * (1 + 1e-12));
  EXPECT_NEAR(
      slopes.jacobians, network.Bound(),
      testing::RecordBound("steepest Jacobian of a linear network", testing::Computed::kDouble,
                           slopes.jacobians - network.Bound(),
                           1e-4));  // thirty steps of the power iteration
}

TEST(LocalLipschitz, H36_GradientAscentStaysBelowTheBound) {
  LipschitzNetwork network = RandomNetwork(83);
  network.data().has_base = true;
  network.data().base = SomeMap();
  const LocalLipschitz slopes =
      MeasureLocalLipschitz(network, Ball(12), {.pairs = 100000, .jacobians = 100});
  EXPECT_GT(slopes.pairs, 0);
  EXPECT_GE(slopes.jacobians, 0.5 * slopes.pairs);
  EXPECT_GE(slopes.ascent, slopes.jacobians);
  EXPECT_LE(slopes.ascent,
            network.Bound() * testing::RecordBound("maximum by gradient ascent, over the bound",
                                                   testing::Computed::kDouble,
                                                   slopes.ascent / network.Bound(), 1));
  EXPECT_LE(slopes.pairs,
            network.Bound() * testing::RecordBound("steepest of 100 000 pairs over the bound",
                                                   testing::Computed::kDouble,
                                                   slopes.pairs / network.Bound(), 1));
  EXPECT_LE(slopes.steepest_pair, network.Bound());
  // A chord of 1e-3 is shorter than the curve of a sine by its curvature squared.
  EXPECT_NEAR(slopes.steepest_pair / slopes.ascent, 1, 1e-3);
}

TEST(LocalLipschitz, PairsNearerThanTheirDistanceAreIgnored) {
  const LipschitzNetwork network = RandomNetwork(85);
  RadianceField field = Ball(12);
  for (int64_t i = 0; i < field.appearance.sh.size(); ++i) field.appearance.sh[i] *= 1e-5f;
  // Positions are a twelfth of the box apart, times the network's scale of 1.
  EXPECT_GT(MeasureLocalLipschitz(network, field, {.pairs = 3000, .jacobians = 1}).pairs, 0);
  EXPECT_EQ(
      MeasureLocalLipschitz(network, field, {.pairs = 3000, .jacobians = 1, .min_distance = 4})
          .pairs,
      0);
}

TEST(LipschitzNetwork, RefusesWhatIsNoNetwork) {
  LipschitzNetworkData data = RandomNetwork(84).data();
  EXPECT_NO_THROW(LipschitzNetwork{data});
  for (int defect = 0; defect < 6; ++defect) {
    LipschitzNetworkData bad = data;
    if (defect == 0) bad.parameters.pop_back();
    if (defect == 1) bad.singular_vectors.clear();
    if (defect == 2) bad.parameters[100] = std::numeric_limits<float>::quiet_NaN();
    if (defect == 3) bad.activation = "swish";
    if (defect == 4) bad.basis = 4;
    if (defect == 5) bad.basis = 16;  // and the weights are those of nine
    EXPECT_THROW(LipschitzNetwork{bad}, Error) << defect;
  }
}

// --- features

TEST(FillFeatures, PositionsOfVoxelsAreTheirPlacesInTheBox) {
  const RadianceField field = RandomField({5, 4, 6}, 4, 1.0, 1);
  const GridFrame& frame = field.geometry->frame;
  float row[kFeatureStride];
  FillFeatures(field, 0.5f, 7, frame.Vertex(3, 1, 4), row);
  const Vec3f world = frame.WorldOf({3, 1, 4});
  for (int a = 0; a < 3; ++a) {
    const double expected = (double{world[a]} - frame.center[a]) / double{frame.radius[a]};
    EXPECT_NEAR(row[kNetworkSh + a], 0.5 * expected, 1e-6);  // float's rounding of `world`
  }
  EXPECT_EQ(row[9], field.appearance.sh[7 * 12 + 4]);  // padded to nine harmonics
}

// --- the regularisation

TEST(LipschitzRegularizer, H20_H21_H22_Targets) {
  EXPECT_EQ(LayerTarget(0, 6), 0);
  const double product = std::pow(LayerTarget(2.87, 6), 6);
  EXPECT_NEAR(product, 2.87,
              testing::RecordDigits("product of the targets", testing::Computed::kDouble,
                                    product - 2.87, 6e-14, 2.87));
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
  // Far below the target it is b / (4 |K - target|), which the textbook form rounds away.
  EXPECT_NEAR(LipschitzPenalty(0, 1.2) / (1e-12 / 4.8), 1,
              testing::RecordDigits("penalty far below the target", testing::Computed::kDouble,
                                    LipschitzPenalty(0, 1.2) / (1e-12 / 4.8) - 1, 1e-9));
  EXPECT_NEAR(LipschitzPenaltyDerivative(3.0, 1.2), 1, 1e-9);
  EXPECT_LT(LipschitzPenaltyDerivative(0.5, 1.2), 1e-9);
}

}  // namespace
}  // namespace regrade
