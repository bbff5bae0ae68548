// A map of colours as a table over a cube (a 3D LUT), and how steep it is.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "kernels/base/vec.h"

namespace regrade {

// Colours [size]^3, red fastest, over the box from `low` to `high`, both in sRGB values.
//
// EQ(color-table): the table is interpolated on six tetrahedra of a cell. With the place
// f in [0, 1]^3 in its cell and the axes ordered so that f_a >= f_b >= f_c,
//   T(f) = (1 - f_a) v_0 + (f_a - f_b) v_a + (f_b - f_c) v_ab + f_c v_abc,
// v_0 at the cell's first corner, v_a one step along a, and so on. The map is continuous, keeps
// grey on the line of greys, and is linear in each tetrahedron, with the columns
// v_a - v_0, v_ab - v_a and v_abc - v_ab, each divided by the cell's side along its axis. The
// largest singular value of these matrices is the map's steepest slope, exactly. A colour
// outside the box is moved to its surface first.
struct ColorTable {
  int size = 0;  // at least 2; 0: none
  Vec3d low{0, 0, 0}, high{1, 1, 1};
  std::vector<Vec3f> values;

  const Vec3f& at(int r, int g, int b) const {
    return values[static_cast<size_t>((b * size + g) * size + r)];
  }
  Vec3d operator()(const Vec3d& color) const;
};

// The four vertices around a colour, as indices of `values`, and their weights.
struct TableStencil {
  size_t vertex[4];
  double weight[4];
};
TableStencil StencilOf(const ColorTable& table, const Vec3d& color);

// A curve for each channel (a 1D LUT): [size] values over the same box, linear between them.
struct ColorCurves {
  Vec3d low{0, 0, 0}, high{1, 1, 1};
  std::vector<Vec3f> values;  // at least 2

  Vec3d operator()(const Vec3d& color) const;
};
double SteepestSlope(const ColorCurves& curves);

// `map` at the vertices of a table over [0, 1]^3.
ColorTable TabulateColors(int size, const std::function<Vec3d(const Vec3d&)>& map);

// The largest Lipschitz constant of the interpolated table, see EQ(color-table). Values must be
// finite. The search ends early above `enough`, and what it returns is then a lower bound.
double SteepestSlope(const ColorTable& table, double enough = 1e300);

}  // namespace regrade
