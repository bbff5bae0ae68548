// The Lipschitz layer, the fused network against its plain specification, Adam and its
// schedule.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/base/random.h"
#include "kernels/network/dense_layer.h"
#include "kernels/network/fused_mlp.h"
#include "kernels/network/lipschitz_layer.h"
#include "kernels/optimize/adam.h"
#include "kernels/optimize/schedule.h"
#include "tests/support/derivative.h"
#include "tests/support/floating_point_traps.h"
#include "tests/support/record_error.h"
#include "tests/support/threads.h"

namespace regrade {
namespace {

using testing::DerivativeBy;

double Random(uint64_t stream, uint64_t counter) {  // uniform in [-1, 1)
  return 2 * RandomDouble(20231103, stream, counter) - 1;
}

template <typename T>
struct Matrix {
  int outputs, inputs;
  std::vector<T> weight, u, v;

  Matrix(int outputs, int inputs, uint64_t stream, T scale = 1)
      : outputs(outputs), inputs(inputs), weight(outputs * inputs), u(outputs), v(inputs) {
    for (size_t i = 0; i < weight.size(); ++i)
      weight[i] = static_cast<T>(Random(stream, i)) * scale;
  }
  SpectralView<T> View() { return {outputs, inputs, weight.data(), u.data(), v.data()}; }
};

TEST(LipschitzLayer, H37_WarmedUpSigmaIsTheNorm) {
  Matrix<double> m(3, 2, 1);
  m.weight = {3, 0, 0, 4, 0, 0};
  EXPECT_NEAR(WarmUpPowerIteration(m.View()) * LargestMagnitude(m.View()), 4, 1e-12);
  Matrix<double> r(64, 64, 2);
  const double sigma = WarmUpPowerIteration(r.View());
  double longer = sigma;
  for (int i = 0; i < 5000; ++i) longer = PowerStep(r.View());
  EXPECT_GE(sigma / longer,
            1 - testing::RecordBound("deficit of the norm after the warm-up",
                                     testing::Computed::kDouble, 1 - sigma / longer, 1e-3));
  EXPECT_LE(sigma / longer, 1 + 1e-12);
}

TEST(LipschitzLayer, H39_ZeroWeightGivesZeroAndAFiniteGradient) {
  Matrix<float> m(4, 3, 3, 0.0f);
  EXPECT_EQ(WarmUpPowerIteration(m.View()), 0.0f);
  std::vector<float> a(12, 7.0f), d_a(12, 1.0f), d_w(12);
  float d_k = 0;
  LipschitzWeight(m.View(), 1.0f, a.data());
  LipschitzWeightAdjoint(m.View(), 1.0f, d_a.data(), d_w.data(), &d_k);
  for (int i = 0; i < 12; ++i) {
    EXPECT_EQ(a[i], 0.0f);
    EXPECT_EQ(d_w[i], 0.0f);
  }
  EXPECT_EQ(d_k, 0.0f);
}

TEST(LipschitzLayer, H40_RankOneIsFoundWhereverItsVectorPoints) {
  for (int column = 0; column < 5; ++column) {
    Matrix<double> m(6, 5, 4, 0.0);
    m.weight[2 * 5 + column] = -2.5;
    const double norm = WarmUpPowerIteration(m.View()) * LargestMagnitude(m.View());
    EXPECT_NEAR(norm, 2.5,
                testing::RecordDigits("norm of rank one", testing::Computed::kDouble,
                                      norm - 2.5, 4e-13, 2.5));
  }
  // A vector u orthogonal to the range of W restarts instead of staying at zero.
  Matrix<double> m(2, 2, 4, 0.0);
  m.weight = {1, 0, 0, 0};
  m.u = {0, 1};
  EXPECT_NEAR(PowerStep(m.View()), 1, 1e-12);
}

TEST(LipschitzLayer, H41_EqualSingularValues) {
  Matrix<double> m(2, 2, 5);
  const double c = std::cos(0.7), s = std::sin(0.7);
  m.weight = {c, -s, s, c};
  const double norm = WarmUpPowerIteration(m.View()) * LargestMagnitude(m.View());
  EXPECT_NEAR(
      norm, 1,
      testing::RecordDigits("norm of a rotation", testing::Computed::kDouble, norm - 1, 1e-12));
}

TEST(LipschitzLayer, H42_ScaleOfWDoesNotMatter) {
  Matrix<float> one(8, 6, 6);
  WarmUpPowerIteration(one.View());
  std::vector<float> a(48), scaled(48);
  LipschitzWeight(one.View(), 1.5f, a.data());
  for (int e = -30; e <= 30; e += 5) {
    Matrix<float> m(8, 6, 6, static_cast<float>(std::pow(10.0, e)));
    WarmUpPowerIteration(m.View());
    LipschitzWeight(m.View(), 1.5f, scaled.data());
    // Scaling rounds W by half an ulp; sigma amplifies that by at most sqrt(48) / 2.
    for (int i = 0; i < 48; ++i)
      EXPECT_NEAR(scaled[i], a[i],
                  testing::RecordDigits("weights at any scale", testing::Computed::kFloat,
                                        scaled[i] - a[i], 4e-7))
          << e;
  }
}

TEST(LipschitzLayer, H43_SigmaBetweenFrobeniusBounds) {
  for (int t = 0; t < 50; ++t) {
    Matrix<float> m(1 + t % 9, 1 + t % 7, 100 + t);
    const float sigma = WarmUpPowerIteration(m.View()) * LargestMagnitude(m.View());
    double square = 0;
    for (const float w : m.weight) square += static_cast<double>(w) * w;
    EXPECT_LE(sigma, std::sqrt(square) *
                         testing::RecordBound("norm over Frobenius", testing::Computed::kFloat,
                                              sigma / std::sqrt(square), 1 + 4 * 1.2e-7));
    EXPECT_GE(sigma, std::sqrt(square / m.inputs) * (1 - 4 * 1.2e-7));
  }
}

TEST(LipschitzLayer, H46_H47_GradientWithFrozenVectors) {
  Matrix<double> m(5, 4, 7);
  WarmUpPowerIteration(m.View());
  Matrix<double> d_a(5, 4, 8);
  double k = 0.8;
  const auto loss = [&] {
    std::vector<double> a(20);
    LipschitzWeight(m.View(), k, a.data());
    double sum = 0;
    for (int i = 0; i < 20; ++i) sum += a[i] * d_a.weight[i];
    return sum;
  };
  std::vector<double> d_w(20);
  double d_k = 0;
  LipschitzWeightAdjoint(m.View(), k, d_a.weight.data(), d_w.data(), &d_k);
  for (int i = 0; i < 20; ++i) {
    const double numeric = DerivativeBy(&m.weight[i], loss, 1e-3);
    EXPECT_NEAR(d_w[i], numeric,
                testing::RecordDigits("gradient by W", testing::Computed::kDouble,
                                      d_w[i] - numeric, 1e-8))
        << i;
  }
  // Also near squareplus' bend, at the root of b: a step of a hundredth of it has a relative
  // truncation error of 1e-8 and a rounding error of 1e-8.
  for (const double at : {0.8, 1e-6, 0.0, -1e-6}) {
    k = at;
    d_k = 0;
    LipschitzWeightAdjoint(m.View(), k, d_a.weight.data(), d_w.data(), &d_k);
    const double numeric = DerivativeBy(&k, loss, at > 0.1 ? 1e-3 : 1e-8);
    EXPECT_NEAR(d_k, numeric,
                at > 0.1 ? testing::RecordDigits("gradient by K", testing::Computed::kDouble,
                                                 d_k - numeric, 1e-9)
                         : testing::RecordDigits("gradient by K at squareplus's bend",
                                                 testing::Computed::kDouble, d_k - numeric,
                                                 1e-6, std::abs(numeric)))
        << at;
  }
}

// --- the network

template <typename T>
DenseNetwork<T> RandomNetwork(Activation activation, std::vector<int> sizes) {
  DenseNetwork<T> network;
  network.activation = activation;
  for (size_t l = 0; l + 1 < sizes.size(); ++l) {
    DenseLayer<T> layer(sizes[l + 1], sizes[l]);
    for (size_t i = 0; i < layer.weight.size(); ++i)
      layer.weight[i] = static_cast<T>(Random(10 + l, i) * std::sqrt(3.0 / sizes[l]));
    for (size_t i = 0; i < layer.bias.size(); ++i)
      layer.bias[i] = static_cast<T>(Random(20 + l, i));
    network.layers.push_back(std::move(layer));
  }
  return network;
}

template <typename T>
DenseNetwork<T> ZeroLike(const DenseNetwork<float>& network) {
  DenseNetwork<T> zero;
  for (const auto& layer : network.layers)
    zero.layers.emplace_back(layer.outputs, layer.inputs);
  return zero;
}

const std::vector<int> kPaperSizes = {30, 64, 64, 64, 64, 64, 27},
                       kWideSizes = {51, 64, 64, 64, 64, 64, 48};
constexpr Activation kAll[] = {Activation::kSine, Activation::kRelu, Activation::kLeakyRelu,
                               Activation::kSigmoid, Activation::kTanh};

TEST(DenseNetwork, AdjointAgainstRichardson) {
  for (const Activation activation : kAll) {
    DenseNetwork<double> network = RandomNetwork<double>(activation, {4, 6, 5, 3});
    network.omega = 1.3;
    DenseNetwork<double> gradient = network;
    for (auto& layer : gradient.layers) {
      std::fill(layer.weight.begin(), layer.weight.end(), 0);
      std::fill(layer.bias.begin(), layer.bias.end(), 0);
    }
    std::vector<double> x = {0.3, -0.8, 0.5, 0.1}, d_x(4);
    const std::vector<double> d_y = {1.0, -2.0, 0.7};
    DenseAdjoint(network, x.data(), d_y.data(), &gradient, d_x.data());
    const auto loss = [&] {
      double y[3];
      DenseForward(network, x.data(), y);
      return y[0] * d_y[0] + y[1] * d_y[1] + y[2] * d_y[2];
    };
    const auto check = [&](double* value, double analytic) {
      const double numeric = DerivativeBy(value, loss, 1e-3);
      EXPECT_NEAR(
          analytic, numeric,
          testing::RecordDigits("gradient of a dense network", testing::Computed::kDouble,
                                analytic - numeric, 1e-8, std::max(1.0, std::abs(numeric))));
    };
    for (size_t l = 0; l < network.layers.size(); ++l) {
      for (size_t i = 0; i < network.layers[l].weight.size(); ++i)
        check(&network.layers[l].weight[i], gradient.layers[l].weight[i]);
      for (size_t i = 0; i < network.layers[l].bias.size(); ++i)
        check(&network.layers[l].bias[i], gradient.layers[l].bias[i]);
    }
    for (int i = 0; i < 4; ++i) check(&x[i], d_x[i]);
  }
}

TEST(FusedMlp, H45_SineAndCosine) {
  const testing::MayBeNotFinite allowed;
  for (const char* name : {"baseline", "avx2", "avx512"}) {
    const FusedMlpFunctions* functions = FusedMlpFor(name);
    if (functions == nullptr) continue;
    std::vector<float> x;
    for (int i = -500000; i <= 500000; ++i) x.push_back(i * 1e-4f);  // |x| <= 50
    for (int i = 0; i < 20000; ++i)
      x.push_back(std::ldexp(1.0f, 6) * (1 + i * 7.7e-3f));  // to 1e4
    x.push_back(1e30f);
    std::vector<float> sine(x.size()), cosine(x.size());
    functions->sine_cosine(x.data(), static_cast<int64_t>(x.size()), sine.data(),
                           cosine.data());
    double worst = 0;
    for (size_t i = 0; i < x.size(); ++i)
      worst = std::max({worst, std::abs(sine[i] - std::sin(static_cast<double>(x[i]))),
                        std::abs(cosine[i] - std::cos(static_cast<double>(x[i])))});
    EXPECT_LE(worst,
              testing::RecordDigits("sine and cosine", testing::Computed::kFloat, worst, 2e-7))
        << name;
    float bad = std::numeric_limits<float>::quiet_NaN(), s, c;
    functions->sine_cosine(&bad, 1, &s, &c);
    EXPECT_TRUE(std::isnan(s) && std::isnan(c));
  }
}

// Of rows of 32 lanes and of 64.
class FusedMlpOf : public ::testing::TestWithParam<std::vector<int>> {};
INSTANTIATE_TEST_SUITE_P(Sizes, FusedMlpOf, ::testing::Values(kPaperSizes, kWideSizes));

TEST_P(FusedMlpOf, AgreesWithPlainDouble) {
  constexpr int kRows = 1003;  // ends inside a block
  const std::vector<int>& sizes = GetParam();
  const int inputs = sizes.front(), outputs = sizes.back(), lanes = MlpEndLanes(inputs);
  for (const Activation activation : kAll)
    for (const char* name : {"baseline", "avx2", "avx512"}) {
      if (FusedMlpFor(name) == nullptr) continue;
      UseFusedMlp(name);
      const DenseNetwork<float> network = RandomNetwork<float>(activation, sizes);
      DenseNetwork<double> reference;
      reference.activation = activation;
      for (const auto& layer : network.layers) {
        reference.layers.emplace_back(layer.outputs, layer.inputs);
        auto& copy = reference.layers.back();
        std::copy(layer.weight.begin(), layer.weight.end(), copy.weight.begin());
        std::copy(layer.bias.begin(), layer.bias.end(), copy.bias.begin());
      }
      std::vector<float> x(kRows * lanes), y(x.size()), d_y(x.size());
      for (int r = 0; r < kRows; ++r) {
        for (int i = 0; i < inputs; ++i) x[r * lanes + i] = Random(30, r * inputs + i);
        for (int i = 0; i < outputs; ++i) d_y[r * lanes + i] = Random(31, r * outputs + i);
      }
      const FusedMlp mlp = MakeFusedMlp(network);
      FusedForward(mlp, x.data(), kRows, y.data());
      DenseNetwork<double> gradient = ZeroLike<double>(network);
      FusedAdjoint(mlp, x.data(), d_y.data(), kRows, &gradient);

      DenseNetwork<double> expected = ZeroLike<double>(network);
      double worst = 0, largest = 0;
      for (int r = 0; r < kRows; ++r) {
        std::vector<double> xd(inputs), yd(outputs), d_yd(outputs);
        std::copy_n(&x[r * lanes], inputs, xd.begin());
        std::copy_n(&d_y[r * lanes], outputs, d_yd.begin());
        DenseForward(reference, xd.data(), yd.data());
        DenseAdjoint(reference, xd.data(), d_yd.data(), &expected,
                     static_cast<double*>(nullptr));
        for (int i = 0; i < outputs; ++i) {
          worst = std::max(worst, std::abs(yd[i] - y[r * lanes + i]));
          largest = std::max(largest, std::abs(yd[i]));
        }
      }
      EXPECT_LE(worst, testing::RecordDigits("the fused network, of its largest",
                                             testing::Computed::kFloat, worst, 1e-5, largest))
          << name;
      for (size_t l = 0; l < expected.layers.size(); ++l) {
        double difference = 0, norm = 0;
        const auto compare = [&](const std::vector<double>& a, const std::vector<double>& b) {
          for (size_t i = 0; i < a.size(); ++i) {
            difference += (a[i] - b[i]) * (a[i] - b[i]);
            norm += b[i] * b[i];
          }
        };
        compare(gradient.layers[l].weight, expected.layers[l].weight);
        compare(gradient.layers[l].bias, expected.layers[l].bias);
        EXPECT_LE(
            std::sqrt(difference),
            testing::RecordDigits("its gradient, of a layer's norm", testing::Computed::kFloat,
                                  std::sqrt(difference), 1e-5, std::sqrt(norm)))
            << name << " layer " << l << " activation " << static_cast<int>(activation);
      }
    }
  UseFusedMlp(nullptr);
}

TEST(FusedMlp, ThreadsDoNotChangeABit) {
  constexpr int kRows = 20000;
  const DenseNetwork<float> network = RandomNetwork<float>(Activation::kSine, kPaperSizes);
  const FusedMlp mlp = MakeFusedMlp(network);
  std::vector<float> x(kRows * mlp.ends), y[2];
  for (size_t i = 0; i < x.size(); ++i) x[i] = i % 32 < 27 ? Random(32, i) : 0;
  DenseNetwork<double> gradient[2] = {ZeroLike<double>(network), ZeroLike<double>(network)};
  for (int t = 0; t < 2; ++t) {
    const testing::Threads threads(t == 0 ? 1 : 5);
    y[t].resize(x.size());
    FusedForward(mlp, x.data(), kRows, y[t].data());
    FusedAdjoint(mlp, x.data(), x.data(), kRows, &gradient[t]);
  }
  EXPECT_TRUE(
      testing::RecordSameBits("1 and 5 threads", testing::Computed::kFloat, y[0] == y[1]));
  for (size_t l = 0; l < 6; ++l) {
    EXPECT_EQ(gradient[0].layers[l].weight, gradient[1].layers[l].weight);
    EXPECT_EQ(gradient[0].layers[l].bias, gradient[1].layers[l].bias);
  }
}

}  // namespace
}  // namespace regrade
