#include "stylize/training/initial_network.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/field/spherical_harmonics.h"
#include "stylize/spectral_norm.h"

namespace regrade {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr int kLast = kNetworkLayers - 1;

// Streams of their own, far from the steps' (which count from 0).
uint64_t StreamOf(int layer, int part) {
  return ~uint64_t{0} - 16 - 2 * static_cast<uint64_t>(layer) - static_cast<uint64_t>(part);
}

double Uniform(uint64_t seed, uint64_t stream, int64_t i) {  // in [-1, 1)
  return 2 * RandomDouble(seed, stream, static_cast<uint64_t>(i)) - 1;
}

double Normal(uint64_t seed, uint64_t stream, int64_t i) {  // Box and Muller
  const uint64_t counter = 2 * static_cast<uint64_t>(i);
  const double u = 1 - RandomDouble(seed, stream, counter);
  return std::sqrt(-2 * std::log(u)) *
         std::cos(2 * M_PI * RandomDouble(seed, stream, counter + 1));
}

// [rows, columns] with orthonormal rows or columns, whichever are fewer.
Eigen::MatrixXd RandomIsometry(int rows, int columns, uint64_t seed, uint64_t stream) {
  const int tall = std::max(rows, columns), narrow = std::min(rows, columns);
  Eigen::MatrixXd random(tall, narrow);
  for (int i = 0; i < tall; ++i)
    for (int j = 0; j < narrow; ++j)
      random(i, j) = Normal(seed, stream, static_cast<int64_t>(i) * narrow + j);
  const Eigen::MatrixXd q = Eigen::HouseholderQR<Eigen::MatrixXd>(random).householderQ() *
                            Eigen::MatrixXd::Identity(tall, narrow);
  return rows >= columns ? q : Eigen::MatrixXd(q.transpose());
}

// K_i = ||W_i||_2, so that A_i = W_i.
void UseWeightsNorms(LipschitzNetwork* network) {
  network->WarmUpNorms();
  for (int l = 0; l < kNetworkLayers; ++l)
    network->k(l) = static_cast<float>(network->NormEstimate(l));
}

void InitializeAsSiren(const std::string& start, uint64_t seed, LipschitzNetwork* network) {
  constexpr double kOmega = 30;
  for (int l = 0; l < kNetworkLayers; ++l) {
    const double n = network->Inputs(l);
    double range = std::sqrt(6 / n), bias = kOmega / std::sqrt(n);
    if (l == 0 && start != "siren-even") range = kOmega / n;
    if (l == kLast) {
      bias = 1 / std::sqrt(n);
      if (start == "siren") range /= kOmega;
    }
    const int64_t weights = network->bias(l) - network->weight(l);
    for (int64_t i = 0; i < weights; ++i)
      network->weight(l)[i] = static_cast<float>(range * Uniform(seed, StreamOf(l, 0), i));
    for (int o = 0; o < network->Outputs(l); ++o)
      network->bias(l)[o] = static_cast<float>(bias * Uniform(seed, StreamOf(l, 1), o));
  }
  UseWeightsNorms(network);
}

}  // namespace

void InitializeAsPyTorch(uint64_t seed, LipschitzNetwork* network) {
  for (int l = 0; l < kNetworkLayers; ++l) {
    const int64_t size = &network->k(l) - network->weight(l);
    const double range = 1 / std::sqrt(static_cast<double>(network->Inputs(l)));
    for (int64_t i = 0; i < size; ++i)
      network->weight(l)[i] = static_cast<float>(range * Uniform(seed, StreamOf(l, 0), i));
  }
  UseWeightsNorms(network);
}

void InitializeWithoutMap(const std::string& start, uint64_t seed, LipschitzNetwork* network) {
  if (start.starts_with("siren")) return InitializeAsSiren(start, seed, network);
  InitializeAsPyTorch(seed, network);
  if (start == "pytorch") return;
  REGRADE_CHECK(start == "orthogonal" || start == "identity");
  constexpr float kSmallBias = 0.05f, kHalf = 0.5f;
  for (int l = 0; l < kNetworkLayers; ++l) {
    const int outputs = network->Outputs(l), inputs = network->Inputs(l);
    const auto weight = [&](int o, int i) -> float& {
      return network->weight(l)[static_cast<int64_t>(o) * inputs + i];
    };
    for (int o = 0; o < outputs; ++o) network->bias(l)[o] *= kSmallBias;
    if (start == "orthogonal") {
      const Eigen::MatrixXd w = RandomIsometry(outputs, inputs, seed, StreamOf(l, 0));
      for (int o = 0; o < outputs; ++o)
        for (int i = 0; i < inputs; ++i) weight(o, i) = static_cast<float>(w(o, i));
      continue;
    }
    const int through = std::min({outputs, inputs, network->Inputs(0)});
    const float gain = l == 0 ? kHalf : l == kLast ? 1 / kHalf : 1;
    for (int o = 0; o < through; ++o)
      for (int i = 0; i < inputs; ++i) weight(o, i) = o == i ? gain : 0;
  }
  UseWeightsNorms(network);
}

void InitializeResidual(uint64_t seed, LipschitzNetwork* network) {
  // What measurements favoured: a little more than 1 in each hidden layer leaves room for what
  // the sine's slopes take away, and small biases keep the deeper layers near their linear
  // range.
  constexpr double kHiddenK = 1.2, kFirstBias = M_PI, kOtherBias = 0.3;
  for (int l = 0; l < kLast; ++l) {
    const int outputs = network->Outputs(l), inputs = network->Inputs(l);
    const Eigen::MatrixXd w = RandomIsometry(outputs, inputs, seed, StreamOf(l, 0));
    for (int o = 0; o < outputs; ++o) {
      for (int i = 0; i < inputs; ++i)
        network->weight(l)[static_cast<int64_t>(o) * inputs + i] = static_cast<float>(w(o, i));
      network->bias(l)[o] = static_cast<float>((l == 0 ? kFirstBias : kOtherBias) *
                                               Uniform(seed, StreamOf(l, 1), o));
    }
    network->k(l) = static_cast<float>(kHiddenK);
  }
  ClearLastLayer(network);
  network->k(kLast) = 1;
  network->WarmUpNorms();
}

void ClearLastLayer(LipschitzNetwork* network) {
  std::fill(network->weight(kLast), &network->k(kLast), 0.0f);  // weights and biases
}

void SolveOutputLayer(const StyleLoss::HiddenSums& sums, double budget,
                      LipschitzNetwork* network) {
  constexpr int kSize = kMlpHidden + 1;
  const int64_t n = std::ssize(sums.opacity);
  if (n == 0) return;
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(kSize, kSize);
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(kSize, 3);
  Eigen::VectorXd x(kSize);
  for (int64_t r = 0; r < n; ++r) {
    for (int i = 0; i < kMlpHidden; ++i) x(i) = kSh0 * sums.hidden[r * kMlpHidden + i];
    x(kMlpHidden) = kSh0 * sums.opacity[r];
    gram.selfadjointView<Eigen::Lower>().rankUpdate(x, 1.0 / static_cast<double>(n));
    for (int c = 0; c < 3; ++c)
      right.col(c) += x * (sums.missing[r * 3 + c] / static_cast<double>(n));
  }
  gram = Eigen::MatrixXd(gram.selfadjointView<Eigen::Lower>());

  // What the layers before it do to the bound: a last layer of norm 1.
  ClearLastLayer(network);
  network->weight(kLast)[0] = 1;
  network->k(kLast) = 1;
  network->WarmUpNorms();
  const double hidden_bound = network->LearnedBound();
  ClearLastLayer(network);
  for (double ridge = 1e-6; ridge < 1e6; ridge *= 2) {
    Eigen::MatrixXd system = gram;
    system.diagonal().head(kMlpHidden).array() += ridge;
    system(kMlpHidden, kMlpHidden) += 1e-9;  // rays that meet nothing leave b free
    const Eigen::MatrixXd solution = system.ldlt().solve(right);
    const Eigen::MatrixXd w = solution.topRows(kMlpHidden);
    std::vector<double> rows(static_cast<size_t>(w.size()));
    Eigen::Map<RowMajor>(rows.data(), w.rows(), w.cols()) = w;
    if (!(hidden_bound * SpectralNorm(rows, kMlpHidden, 3) <= budget)) continue;
    const int basis = network->row().basis;
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < kMlpHidden; ++i)
        network->weight(kLast)[c * basis * kMlpHidden + i] = static_cast<float>(w(i, c));
      network->bias(kLast)[c * basis] = static_cast<float>(solution(kMlpHidden, c));
    }
    break;
  }
  network->WarmUpNorms();
  network->k(kLast) = static_cast<float>(network->NormEstimate(kLast));
}

}  // namespace regrade
