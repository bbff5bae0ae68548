// Densities of a mixture's parts, and the shares that they have in a colour.
#pragma once

#include <cstddef>
#include <vector>

#include "stylize/image/gaussian_mixture.h"

namespace regrade {

struct PartDensity {
  double log_scale = 0;  // ln w - ln det S / 2, without the constant of all Gaussians
  Vec3d mean{};
  Mat3d whitening;  // lower triangular W, W^T W = S^-1
};

// Of parts whose eigenvalues are raised to `least`; regular ones need none (0).
std::vector<PartDensity> DensitiesOf(const GaussianMixture& mixture, double least);

// shares[k] = r_k, see EQ(gaussian-mixture); they sum to 1 wherever the colour is.
// Returns the mixture's log density, without the constant.
double SharesOf(const std::vector<PartDensity>& parts, const Vec3d& color, double* shares);

}  // namespace regrade
