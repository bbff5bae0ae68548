// Losses of the densities along a ray that Plenoxels adds to the loss of its colour.
//
// EQ(beta-loss), Lombardi et al. 2019 (Neural Volumes), as in svox2: with T_r the transmittance
// behind the box's samples of ray r, of Q rays,
//   L = lambda / Q sum_r (log T_r + log(1 - T_r + 1e-3)),
//   dL/dtau_i = lambda / Q (T_r / (1 - T_r + 1e-3) - 1)   for each sample i of the ray:
// rays become opaque or clear. T in float is exact enough: 1 - T errs by 6e-8, beside 1e-3.
//
// EQ(sparsity-loss), Hedman et al. 2021 (SNeRG), as in svox2, which does not divide by Q:
//   L = lambda sum_r sum_i log(1 + 2 sigma_i^2),   dL/dsigma_i = 4 lambda sigma_i / (1 + 2
//   sigma_i^2),
// over the samples with sigma_i > 0.
#pragma once

#include <cmath>

#include "kernels/base/host_device.h"

namespace regrade {

// Weights of a ray's losses, 0 if off: lambda / Q of the first, lambda of the second.
struct DensityLosses {
  float beta = 0;
  float sparsity = 0;

  HD bool on() const { return beta != 0 || sparsity != 0; }
};

// log T + log(1 - T + 1e-3) for T in (0, 1].
template <typename T>
HD T BetaLoss(T transmittance) {
  using std::log;
  return log(transmittance) + log(1 - transmittance + T(1e-3));
}

// d(BetaLoss)/d(tau) of any sample: between -1, behind what is opaque, and 999.
template <typename T>
HD T BetaLossSlope(T transmittance) {
  return transmittance / (1 - transmittance + T(1e-3)) - 1;
}

// log(1 + 2 sigma^2).
template <typename T>
HD T SparsityLoss(T density) {
  using std::log1p;
  return log1p(2 * density * density);
}

template <typename T>
HD T SparsityLossSlope(T density) {
  return 4 * density / (1 + 2 * density * density);
}

// dL/dsigma of one sample of length delta on a ray with this transmittance behind all samples.
template <typename T>
HD T DensityLossSlope(const DensityLosses& losses, T transmittance, T density, T delta) {
  T slope = 0;
  if (losses.beta != 0) slope += T(losses.beta) * delta * BetaLossSlope(transmittance);
  if (losses.sparsity != 0) slope += T(losses.sparsity) * SparsityLossSlope(density);
  return slope;
}

}  // namespace regrade
