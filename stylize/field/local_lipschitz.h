// How steep the network really is on a field's own voxels: the tightness of its bound.
#pragma once

#include <cstdint>

#include "kernels/field/radiance_field.h"
#include "stylize/field/lipschitz_network.h"

namespace regrade {

struct LocalLipschitzOptions {
  int64_t pairs = 20000;    // of voxels, whose features are at least `min_distance` apart
  int64_t jacobians = 500;  // voxels at which the Jacobian's norm is found
  int ascent_steps = 20;    // from the steepest of them, along the gradient of the slope
  double min_distance = 1e-3;
  uint64_t seed = 0;
};

struct LocalLipschitz {
  double pairs = 0;      // largest ||f(x) - f(y)|| / ||x - y|| over the pairs
  double jacobians = 0;  // largest ||J f(x)||_2 at voxels
  // Of the steepest of those voxels: with the position held, and with the coefficients held.
  double along_coefficients = 0, along_position = 0;
  double ascent = 0;  // largest found by climbing from the steepest of them, off the data
  // What the maximum's own pair says: the points `min_distance` apart about it, along the
  // steepest direction. No derivative has a part in it.
  double steepest_pair = 0;
  double OnData() const { return pairs > jacobians ? pairs : jacobians; }
};

// In double. x = (s, q) as in EQ(liprf-network). None can exceed LipschitzNetwork::Bound().
LocalLipschitz MeasureLocalLipschitz(const LipschitzNetwork& network,
                                     const RadianceField& field,
                                     const LocalLipschitzOptions& options);

}  // namespace regrade
