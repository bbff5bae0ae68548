// The steepest pair of inputs of a Lipschitz network, found at random: an attack on its bound.
#pragma once

#include "tests/support/styled_ball.h"

namespace regrade::testing {

// Calls body(x, y, f(x), f(y), ||x - y||) for pairs of arbitrary points, near and far.
template <typename Body>
void ForRandomPairs(const LipschitzNetwork& network, int pairs, const Body& body) {
  const DenseNetwork<double> f = network.Effective<double>();
  for (int i = 0; i < pairs; ++i) {
    double x[kLargestRow.stride()] = {}, y[kLargestRow.stride()] = {};
    double fx[kLargestRow.sh()], fy[kLargestRow.sh()];
    const double reach = std::pow(10.0, -3 + 3 * (i % 7) / 6.0);
    double distance = 0;
    for (int k = 0; k < network.row().inputs(); ++k) {
      x[k] = 2 * Random(70, static_cast<uint64_t>(i) * 64 + k);
      y[k] = x[k] + reach * Random(71, static_cast<uint64_t>(i) * 64 + k);
      distance += (x[k] - y[k]) * (x[k] - y[k]);
    }
    DenseForward(f, x, fx);
    DenseForward(f, y, fy);
    if (network.data().has_base) {
      AddBaseMap(network.data().base, network.row().basis, x, fx);
      AddBaseMap(network.data().base, network.row().basis, y, fy);
    }
    body(x, y, fx, fy, std::sqrt(distance));
  }
}

inline double SteepestPair(const LipschitzNetwork& network, int pairs) {
  double steepest = 0;
  ForRandomPairs(
      network, pairs,
      [&](const double*, const double*, const double* fx, const double* fy, double distance) {
        double change = 0;
        for (int k = 0; k < network.row().sh(); ++k)
          change += (fx[k] - fy[k]) * (fx[k] - fy[k]);
        steepest = std::max(steepest, std::sqrt(change) / distance);
      });
  return steepest;
}

}  // namespace regrade::testing
