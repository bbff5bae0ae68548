// LipRF's adaptive Lipschitz regularisation.
//
// EQ(liprf-regularizer), LipRF eq. 13:  L_Lip = sum_i squareplus(K_i - K_est^(1/l), b),  l = 6:
// the number of weight matrices, the same in the root and in the product, so that all K_i at
// the root give a product of K_est.
#pragma once

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/base/host_device.h"
#include "kernels/network/lipschitz_layer.h"

namespace regrade {

inline constexpr double kLargestKEst = 1e3;

// K_est^(1/layers), and 0 for 0: never differentiated, its slope there is infinite. K_est above
// kLargestKEst is no style but a broken map: it is cut there (`capped` says so).
inline double LayerTarget(double k_est, int layers, bool* capped = nullptr) {
  if (!std::isfinite(k_est) || k_est < 0)
    throw InputError("the style's linear map has no finite norm", "",
                     "look at the styled views: they must be pictures of the same scene");
  if (capped != nullptr) *capped = k_est > kLargestKEst;
  return k_est > 0 ? std::pow(std::min(k_est, kLargestKEst), 1.0 / layers) : 0.0;
}

HD inline double LipschitzPenalty(double k, double target) { return Squareplus(k - target); }
HD inline double LipschitzPenaltyDerivative(double k, double target) {
  return SquareplusDerivative(k - target);
}

}  // namespace regrade
