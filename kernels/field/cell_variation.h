// Total variation of an adaptive field, value and gradient: the plain specification.
//
// EQ(cell-variation): TV = sum over cells of sqrt(1e-9 + sum_a d_a^2), separately for each
// value; d_a is the mean of the four differences along axis a between the cell's corners. A
// density counts in optical depth: times the cell's width in world units. A cell knows nothing
// of its neighbours, so the sum has no faces between levels.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/field/cell_grid.h"
#include "kernels/field/grid_frame.h"

namespace regrade {

// Width of a cell of `voxels` in world units: of its axes' lengths, the geometric mean.
HD inline float WorldWidth(const GridFrame& frame, int voxels) {
  const Vec3f scale = frame.Scale();
  return static_cast<float>(voxels) / std::cbrt(scale.x * scale.y * scale.z);
}

// values [V, stride]: the value at `index` of each vertex, times `unit` [levels] of the cell's
// level. Adds scale * gradient to d_values if it is not null; returns the unscaled sum over
// cells [begin, end).
template <typename T>
T CellVariation(const CellsView& cells, const T* values, int stride, int index, const T* unit,
                int64_t begin, int64_t end, T scale, T* d_values) {
  T sum = 0;
  for (int64_t c = begin; c < end; ++c) {
    const int32_t* corner = cells.corner + 8 * c;
    const T u = unit[cells.level[c]];
    T d[3] = {};
    for (int k = 0; k < 8; ++k) {
      const T v = u * values[int64_t{corner[k]} * stride + index];
      for (int a = 0; a < 3; ++a) d[a] += k >> (2 - a) & 1 ? v / 4 : -v / 4;
    }
    const T root = std::sqrt(T(1e-9) + d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    sum += root;
    if (d_values == nullptr) continue;
    for (int k = 0; k < 8; ++k) {
      T g = 0;
      for (int a = 0; a < 3; ++a) g += k >> (2 - a) & 1 ? d[a] : -d[a];
      d_values[int64_t{corner[k]} * stride + index] += scale * u * g / (4 * root);
    }
  }
  return sum;
}

}  // namespace regrade
