// Total variation of a sparse grid, value and gradient: the plain specification.
//
// EQ(total-variation): TV = sum over stored vertices of sqrt(1e-9 + sum_a (N_a / 256)^2 (v(p +
// e_a) - v(p))^2), separately for each value (svox2's weighting per axis; H98: voxels that are
// not cubes are weighted by N_a). No difference is taken across the box's border. An empty
// neighbour counts as 0 for densities (a surface is an edge) and as the voxel's own value for
// colours (no edge). One function gives value and gradient; svox2's differ in their epsilon and
// in the position of the axis weight.
#pragma once

#include <cmath>

#include "kernels/field/radiance_field.h"

namespace regrade {

inline constexpr double kVariationEpsilon = 1e-9;

// values [N, stride]: the value at `index` of each voxel. Adds scale * gradient to d_values if
// it is not null; returns the unscaled sum over vertices [begin, end).
template <typename T>
T TotalVariation(const GridFrame& frame, const int32_t* links, const T* values, int stride,
                 int index, bool empty_is_zero, int64_t begin, int64_t end, T scale,
                 T* d_values) {
  const Vec3i n = frame.resolution;
  const int64_t strides[3] = {static_cast<int64_t>(n.y) * n.z, n.z, 1};
  T sum = 0;
  for (int64_t vertex = begin; vertex < end; ++vertex) {
    const int32_t link = links[vertex];
    if (link < 0) continue;
    const int64_t at[3] = {vertex / strides[0], vertex / strides[1] % n.y, vertex % n.z};
    const T own = values[static_cast<int64_t>(link) * stride + index];
    int32_t neighbour[3];
    T weighted[3];  // N_a / 256 times the difference
    T radicand = T(kVariationEpsilon);
    for (int a = 0; a < 3; ++a) {
      const bool in_box = at[a] + 1 < n[a];
      neighbour[a] = in_box ? links[vertex + strides[a]] : -1;
      T other = own;
      if (neighbour[a] >= 0)
        other = values[static_cast<int64_t>(neighbour[a]) * stride + index];
      else if (in_box && empty_is_zero)
        other = 0;
      weighted[a] = T(n[a]) / T(256) * (other - own);
      radicand += weighted[a] * weighted[a];
    }
    const T root = std::sqrt(radicand);
    sum += root;
    if (d_values == nullptr) continue;
    for (int a = 0; a < 3; ++a) {
      const T d = scale * T(n[a]) / T(256) * weighted[a] / root;
      d_values[static_cast<int64_t>(link) * stride + index] -= d;
      if (neighbour[a] >= 0) d_values[static_cast<int64_t>(neighbour[a]) * stride + index] += d;
    }
  }
  return sum;
}

}  // namespace regrade
