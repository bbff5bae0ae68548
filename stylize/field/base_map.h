// The linear colour maps that a network may start from, and how well each does alone.
#pragma once

#include "kernels/field/radiance_field.h"
#include "stylize/field/gradient_aggregation.h"
#include "stylize/linear_map.h"

namespace regrade {

// The colour map whose restyled field renders closest to the targets, clamps aside.
//
// With S_r = sum_i w_i c_i and O_r = 1 - T_r, a field mapped by (M, b) renders M S_r + b O_r +
// T_r c_bg: EQ(least-squares-color-map) with opacities. Rays that `options` leaves out do not
// count. `weigher`, unless null, is the field's, with the least weight of `options`.
ColorMap LeastSquaresMap(const RadianceField& field, const StyleRays& batch,
                         const AggregationOptions& options, RayWeigher* weigher = nullptr);

// A network whose residual is exactly zero: the map alone, carried into coefficients.
LipschitzNetwork NetworkOfMap(const ColorMap& map, int basis = kMaxVoxelBasis);

// The map as it acts on rows of coefficients: row -> (matrix (x) I_B) row + constant on each
// channel's first.
struct RowMap {
  Mat3f matrix;
  Vec3f constant;
};
RowMap RowMapOf(const ColorMap& map);
// What a network is added to: its base, or nothing.
RowMap BaseOf(const LipschitzNetworkData& data);

}  // namespace regrade
