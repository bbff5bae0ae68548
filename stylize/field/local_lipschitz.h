// The network's empirical Lipschitz constant on a field's voxels: how tight its bound is.
#pragma once

#include <cstdint>

#include "kernels/field/radiance_field.h"
#include "stylize/field/lipschitz_network.h"

namespace regrade {

struct LocalLipschitzOptions {
  int64_t pairs = 20000;    // of voxels, whose features are at least `min_distance` apart
  int64_t jacobians = 500;  // voxels at which the Jacobian's norm is found
  int ascent_steps = 20;    // of gradient ascent from the largest of them
  double min_distance = 1e-3;
  uint64_t seed = 0;
};

struct LocalLipschitz {
  double pairs = 0;      // largest ||f(x) - f(y)|| / ||x - y|| over the pairs
  double jacobians = 0;  // largest ||J f(x)||_2 at voxels
  // At the voxel with the largest norm: with the position fixed, and with the coefficients
  // fixed.
  double along_coefficients = 0, along_position = 0;
  double ascent = 0;  // largest found by gradient ascent from the largest of them, off the data
  // Of the points `min_distance` apart around the maximum, along its steepest direction:
  // without derivatives.
  double steepest_pair = 0;
  double OnData() const { return pairs > jacobians ? pairs : jacobians; }
};

// In double. x = (s, q) as in EQ(liprf-network). None can exceed LipschitzNetwork::Bound().
LocalLipschitz MeasureLocalLipschitz(const LipschitzNetwork& network,
                                     const RadianceField& field,
                                     const LocalLipschitzOptions& options);

}  // namespace regrade
