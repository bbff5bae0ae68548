// LipRF's propositions under their own premises, and how a field that breaks them is reported.
#include "stylize/field/volume_variance.h"
#include "tests/support/exact_weigher.h"
#include "tests/support/record_error.h"
#include "tests/support/row_of_voxels.h"
#include "tests/support/styled_ball.h"

namespace regrade {
namespace {

using namespace testing;  // NOLINT: a test

// Two rays of `samples` samples each: weights that sum to 1 (no background), coefficients of
// nine harmonics, no clamp.
struct TwoRays {
  std::vector<double> weights[2];
  std::vector<std::array<double, kNetworkSh>> sh[2];
  double gamma[2][9];

  TwoRays(uint64_t seed, int samples, double turn) {
    for (int r = 0; r < 2; ++r) {
      double total = 0;
      for (int i = 0; i < samples; ++i) {
        const uint64_t n = static_cast<uint64_t>(i) * 64;
        weights[r].push_back(1 + Random(seed + r, n));
        total += weights[r].back();
        sh[r].emplace_back();
        for (int k = 0; k < kNetworkSh; ++k)
          sh[r].back()[static_cast<size_t>(k)] =
              Random(seed + 2 + r, n + static_cast<uint64_t>(k));
      }
      for (double& w : weights[r]) w /= total;
      const Vec3d direction =
          Normalized(Vec3d{0.3 + turn * r, -0.5, 0.8 - turn * r * Random(seed, 5)});
      ShBasis(9, direction, gamma[r]);
    }
  }
  // of each sample's coefficients what `change` makes of them
  template <typename Change>
  double Vrr(const Change& change) const {
    Vec3d color[2];
    for (int r = 0; r < 2; ++r)
      for (size_t i = 0; i < weights[r].size(); ++i) {
        const std::array<double, kNetworkSh> s = change(sh[r][i]);
        for (int c = 0; c < 3; ++c) {
          double value = 0.5;
          for (int k = 0; k < 9; ++k) value += s[static_cast<size_t>(c * 9 + k)] * gamma[r][k];
          color[r][c] += weights[r][i] * value;
        }
      }
    return Norm(color[0] - color[1]);
  }
  double Vrr() const {
    return Vrr([](const std::array<double, kNetworkSh>& s) { return s; });
  }
  double Turn() const {
    double sum = 0;
    for (int k = 0; k < 9; ++k)
      sum += (gamma[0][k] - gamma[1][k]) * (gamma[0][k] - gamma[1][k]);
    return std::sqrt(sum);
  }
};

ColorMap RandomMap(uint64_t seed) {
  ColorMap map;
  for (int c = 0; c < 3; ++c) {
    for (int d = 0; d < 3; ++d)
      map.matrix(c, d) = 2 * Random(seed, static_cast<uint64_t>(3 * c + d));
    map.offset[c] = Random(seed, static_cast<uint64_t>(9 + c));
  }
  return map;
}

constexpr double kRounding = 1 + 1e-12;  // of some hundred sums in double

TEST(Propositions, One_ALinearMapOfColoursGainsAtMostItsNorm) {
  double tightest = 0;
  for (uint64_t trial = 0; trial < 400; ++trial) {
    const TwoRays rays(1000 + 10 * trial, 1 + static_cast<int>(trial % 12), 0.4);
    const ColorMap map = RandomMap(trial);
    // Lemma 2 carries the map into coefficients.
    const double styled = rays.Vrr([&](const std::array<double, kNetworkSh>& s) {
      std::array<double, kNetworkSh> mapped;
      MapCoefficients(map, 9, s.data(), mapped.data());
      return mapped;
    });
    const double limit = SpectralNorm(map.matrix) * rays.Vrr();
    EXPECT_LE(styled, limit * testing::RecordBound("gain over the norm, 400 pairs of rays",
                                                   testing::Computed::kDouble, styled / limit,
                                                   kRounding))
        << trial;
    tightest = std::max(tightest, styled / limit);
  }
  EXPECT_GT(tightest, 0.98);  // no smaller factor would do
}

TEST(Propositions, One_NeedsWeightsThatSumToOne) {
  // Two equal colours, the second ray half transparent: the offset shows through.
  const ColorMap map{{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, {0.4, 0.4, 0.4}};
  const Vec3d dark{0.01, 0.01, 0.01};
  EXPECT_GT(Norm(map(dark) - map(dark) * 0.5), 10 * Norm(dark - dark * 0.5));
}

// A ReLU network of colours, 3 - 8 - 8 - 3, without hidden biases.
DenseNetwork<double> ColorNetwork(uint64_t seed, double hidden_bias = 0) {
  DenseNetwork<double> network;
  network.activation = Activation::kRelu;
  const int sizes[] = {3, 8, 8, 3};
  for (int l = 0; l < 3; ++l) {
    DenseLayer<double> layer(sizes[l + 1], sizes[l]);
    for (size_t i = 0; i < layer.weight.size(); ++i)
      layer.weight[i] = Random(seed + static_cast<uint64_t>(l), i);
    for (size_t i = 0; i < layer.bias.size(); ++i)
      layer.bias[i] = (l == 2 ? 1 : hidden_bias) * Random(seed + 7, i);
    network.layers.push_back(layer);
  }
  return network;
}

double NormProduct(const DenseNetwork<double>& network) {
  double product = 1;
  for (const auto& layer : network.layers) {  // by the power iteration of many steps
    std::vector<double> v(static_cast<size_t>(layer.inputs), 1.0), u(layer.bias.size());
    double norm = 0;
    for (int step = 0; step < 3000; ++step) {
      double length = 0;
      for (int o = 0; o < layer.outputs; ++o) {
        u[static_cast<size_t>(o)] = 0;
        for (int i = 0; i < layer.inputs; ++i)
          u[static_cast<size_t>(o)] += layer.weight[static_cast<size_t>(o * layer.inputs + i)] *
                                       v[static_cast<size_t>(i)];
      }
      std::fill(v.begin(), v.end(), 0.0);
      for (int o = 0; o < layer.outputs; ++o)
        for (int i = 0; i < layer.inputs; ++i)
          v[static_cast<size_t>(i)] += layer.weight[static_cast<size_t>(o * layer.inputs + i)] *
                                       u[static_cast<size_t>(o)];
      for (const double x : v) length += x * x;
      norm = std::sqrt(std::sqrt(length));  // |A^T A v| = sigma^2
      for (double& x : v) x /= std::sqrt(length);
    }
    product *= norm;
  }
  return product;
}

// Premise and guarantee of Prop. 2: epsilon / T over the samples, and vrr' of the colours.
struct SampleBySample {
  double epsilon = 0, styled = 0;
  SampleBySample(uint64_t seed, int samples, const DenseNetwork<double>& f) {
    Vec3d color[2];
    std::vector<double> weights[2];
    for (int r = 0; r < 2; ++r) {
      double total = 0;
      for (int i = 0; i < samples; ++i) {
        const double w = 1 + 0.8 * Random(seed, static_cast<uint64_t>(i)) +
                         0.1 * r * Random(seed + 1, static_cast<uint64_t>(i));
        weights[r].push_back(w);
        total += w;
      }
      for (double& w : weights[r]) w /= total;
    }
    for (int i = 0; i < samples; ++i) {
      Vec3d weighted[2];
      for (int r = 0; r < 2; ++r) {
        Vec3d c, mapped;
        for (int k = 0; k < 3; ++k) {
          const uint64_t n = static_cast<uint64_t>(3 * i + k);
          c[k] = 0.5 + 0.5 * Random(seed + 2, n) + 0.05 * r * Random(seed + 3, n);
        }
        DenseForward(f, &c.x, &mapped.x);
        weighted[r] = c * weights[r][static_cast<size_t>(i)];
        color[r] += mapped * weights[r][static_cast<size_t>(i)];
      }
      epsilon = std::max(epsilon, samples * Norm(weighted[0] - weighted[1]));
    }
    styled = Norm(color[0] - color[1]);
  }
};

TEST(Propositions, Two_AReluNetworkOfSamplesThatAgreeOneByOne) {
  double tightest = 0;
  for (uint64_t trial = 0; trial < 300; ++trial) {
    const DenseNetwork<double> f = ColorNetwork(40 + 11 * trial);
    const SampleBySample pair(9000 + 5 * trial, 1 + static_cast<int>(trial % 10), f);
    const double limit = NormProduct(f) * pair.epsilon;
    EXPECT_LT(pair.styled,
              limit * testing::RecordBound("gain over the product of norms, 300 networks",
                                           testing::Computed::kDouble, pair.styled / limit,
                                           kRounding))
        << trial;
    tightest = std::max(tightest, pair.styled / limit);
  }
  EXPECT_GT(tightest, 0.05);  // norms of layers multiply up; it is no vacuous guarantee
}

TEST(Propositions, Two_NeedsNetworksWithoutHiddenBias) {
  int broken = 0;
  for (uint64_t trial = 0; trial < 300; ++trial) {
    const DenseNetwork<double> f = ColorNetwork(40 + 11 * trial, 3.0);
    // Sample 1: weight w, colour c / w; sample 2 takes the rest, colour 0. w c is the same for
    // every w, so epsilon is 0.
    Vec3d color[2];
    const double first[2] = {0.2, 0.8};
    for (int r = 0; r < 2; ++r) {
      const Vec3d c = Vec3d{0.1, 0.2, 0.15} / first[r], black{};
      Vec3d mapped, mapped_black;
      DenseForward(f, &c.x, &mapped.x);
      DenseForward(f, &black.x, &mapped_black.x);
      color[r] = mapped * first[r] + mapped_black * (1 - first[r]);
    }
    broken += Norm(color[0] - color[1]) > 1e-3;
    // Without hidden biases the same pair keeps the guarantee: vrr' = 0.
    const DenseNetwork<double> plain = ColorNetwork(40 + 11 * trial);
    for (int r = 0; r < 2; ++r) {
      const Vec3d c = Vec3d{0.1, 0.2, 0.15} / first[r], black{};
      Vec3d mapped, mapped_black;
      DenseForward(plain, &c.x, &mapped.x);
      DenseForward(plain, &black.x, &mapped_black.x);
      color[r] = mapped * first[r] + mapped_black * (1 - first[r]);
    }
    EXPECT_LE(Norm(color[0] - color[1]), 1e-12);
  }
  EXPECT_GT(broken, 100);
}

// The largest singular value of a 3 x 9 matrix in rows: the root of that of b b^T.
double SpectralNormOf(const double (&b)[kNetworkSh]) {
  Mat3d square;
  for (int c = 0; c < 3; ++c)
    for (int d = 0; d < 3; ++d) {
      square(c, d) = 0;
      for (int k = 0; k < 9; ++k) square(c, d) += b[9 * c + k] * b[9 * d + k];
    }
  return std::sqrt(SpectralNorm(square));
}

TEST(Propositions, Three_CoefficientsWithAnOffsetOfEveryHarmonic) {
  double gain = 0;
  for (uint64_t trial = 0; trial < 400; ++trial) {
    const TwoRays rays(5000 + 10 * trial, 1 + static_cast<int>(trial % 9), 0.3);
    const ColorMap map = RandomMap(7 * trial);
    double b[kNetworkSh];
    const bool constant = trial % 2 == 0;
    for (int i = 0; i < kNetworkSh; ++i)
      b[i] = constant && i % 9 != 0 ? 0 : Random(trial + 600, static_cast<uint64_t>(i));
    const double styled = rays.Vrr([&](const std::array<double, kNetworkSh>& s) {
      std::array<double, kNetworkSh> t;
      for (int c = 0; c < 3; ++c)
        for (int k = 0; k < 9; ++k) {
          const size_t n = static_cast<size_t>(k);
          t[static_cast<size_t>(c * 9 + k)] = map.matrix(c, 0) * s[n] +
                                              map.matrix(c, 1) * s[9 + n] +
                                              map.matrix(c, 2) * s[18 + n] + b[c * 9 + k];
        }
      return t;
    });
    const double k1 = SpectralNorm(map.matrix), k2 = constant ? 0 : SpectralNormOf(b);
    const double limit = k1 * rays.Vrr() + k2 * rays.Turn();
    EXPECT_LE(styled, limit * testing::RecordBound("gain over the bound, 400 pairs of rays",
                                                   testing::Computed::kDouble, styled / limit,
                                                   kRounding))
        << trial;
    if (!constant) gain = std::max(gain, styled / (k1 * rays.Vrr()));
  }
  EXPECT_GT(gain, 1);  // the second term is needed
}

// --- fields

LipschitzNetwork GentleNetwork() {
  LipschitzNetwork network = RandomNetwork(301, 0.9);
  network.data().has_base = true;
  network.data().base = SomeMap();
  network.data().base.offset = {0.1, 0.05, 0.1};
  return network;
}

struct StyledField {
  RadianceField source, styled;
  LipschitzNetwork network = GentleNetwork();
  explicit StyledField(float contrast) : source(Ball(20)) {
    for (int64_t i = 0; i < source.appearance.sh.size(); ++i)
      source.appearance.sh[i] *= contrast;
    styled = source;
    styled.appearance = ApplyNetwork(network, source);
  }
  VarianceReport Measure(int64_t pairs) const {
    return MeasureVariance(source, styled, network, NeighbouringPixels(Ring(6, 60), pairs, 3),
                           ExactWeigher(source).get());
  }
};

TEST(VolumeVariance, NoPairInsideThePremisesExceedsItsBound) {
  const StyledField field(0.3f);
  const VarianceReport report = field.Measure(3000);
  EXPECT_EQ(report.Pairs(), 3000);
  EXPECT_GT(report.valid.pairs, 300);
  // float's rounding of the restyled coefficients, 27 of them about 1
  EXPECT_LE(report.largest_fraction,
            testing::RecordBound("largest share of its bound, 3 000 pairs",
                                 testing::Computed::kFloat, report.largest_fraction, 1 + 1e-4));
  EXPECT_GT(report.largest_fraction, 0.2);
  EXPECT_GT(report.transparent.pairs, 100);  // the ball's rim and what is beside it
}

TEST(VolumeVariance, AnUnfaithfulFieldIsFound) {
  StyledField field(0.3f);
  for (int64_t i = 0; i < field.styled.appearance.sh.size(); i += 27)
    field.styled.appearance.sh[i] +=
        4 * static_cast<float>(Random(9, static_cast<uint64_t>(i)));
  const VarianceReport report = field.Measure(3000);
  EXPECT_GT(report.valid.above, 0);
  EXPECT_GT(report.valid.largest_excess, 0.01);
}

TEST(VolumeVariance, AMapAloneStaysBelowItsNormInsideThePremises) {
  StyledField field(0.3f);
  field.network = NetworkOfMap(SomeMap());
  field.styled.appearance = ApplyNetwork(field.network, field.source);
  const VarianceReport report = field.Measure(3000);
  EXPECT_NEAR(report.k, SpectralNorm(SomeMap().matrix), 1e-12);
  EXPECT_LE(report.largest_fraction, 1 + 1e-4);
  EXPECT_GT(report.largest_fraction, 0.8);  // Prop. 1 is tight
}

TEST(VolumeVariance, ClampedColoursAreSetApart) {
  const VarianceReport strong = StyledField(2.0f).Measure(2000),
                       weak = StyledField(0.1f).Measure(2000);
  EXPECT_GT(strong.clamped.pairs, 500);
  EXPECT_EQ(weak.clamped.pairs, 0);
}

TEST(VolumeVariance, TheSameForAnyNumberOfThreads) {
  const StyledField field(0.5f);
  const VarianceReport one = [&] {
    const Threads single(1);
    return field.Measure(500);
  }();
  const VarianceReport many = field.Measure(500);
  EXPECT_TRUE(testing::RecordSameBits("1 and more threads", testing::Computed::kDouble,
                                      one.valid.sum_styled == many.valid.sum_styled));
  EXPECT_EQ(one.largest_fraction, many.largest_fraction);
}

}  // namespace
}  // namespace regrade
