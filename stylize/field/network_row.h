// The rows of floats that a style's network reads and writes: one for a record.
#pragma once

#include "kernels/base/host_device.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/network/fused_mlp.h"

namespace regrade {

// Coefficients, channel-major, then the position, then zeros. Rows of gradients have the masses
// of EQ(view-penalty) in place of the position.
struct NetworkRow {
  int basis = 9;  // harmonics a channel: 9, or 16 of splats of degree 3

  HD constexpr int sh() const { return 3 * basis; }
  HD constexpr int inputs() const { return sh() + 3; }
  HD constexpr int mass() const { return sh(); }  // the first of three
  HD constexpr int stride() const { return MlpEndLanes(inputs()); }
};

// Of a field with so many harmonics: fewer than nine are padded with zeros.
HD constexpr NetworkRow RowOf(int basis) {
  return {basis <= kMaxVoxelBasis ? kMaxVoxelBasis : kMaxBasis};
}

inline constexpr NetworkRow kLargestRow = RowOf(kMaxBasis);

}  // namespace regrade
