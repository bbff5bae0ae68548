// How well the log gains of photos are known: standard errors of a robust two-way fit, see
// EQ(exposure).
#pragma once

#include <cstddef>
#include <vector>

#include "kernels/base/vec.h"

namespace regrade {

// What the fit leaves of one observation, in log light, and how much that counted.
struct WeightedResidual {
  size_t view = 0, point = 0;
  Vec3d value;
  double weight = 0;  // rho' at the minimum, in (0, 1]
};

// Of each photo's log gains. `groups` has a number for each photo, the same for photos that
// tracks tie together; errors are those of gains with mean zero in each group. Photos without a
// residual have 0.
std::vector<Vec3d> LogGainErrors(const std::vector<WeightedResidual>& residuals,
                                 const std::vector<size_t>& groups, size_t num_points);

// The upper one of an even number; 0 of none.
double MedianOf(std::vector<double> values);

}  // namespace regrade
