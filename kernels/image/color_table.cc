#include "kernels/image/color_table.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/image/color_statistics.h"

namespace regrade {
namespace {

// The six orders of the axes.
constexpr int kOrders[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2},
                               {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};

double LargestSingularValue(const Mat3d& m) {
  return std::sqrt(std::max(0.0, SymmetricEigen(m.Transposed() * m).values.z));
}

// The steepest tetrahedron of a cell, if it is steeper than `largest`.
double SteepestInCell(const ColorTable& table, const int (&cell)[3], const Vec3d& side,
                      double largest) {
  for (const auto& order : kOrders) {
    Mat3d slope;
    double frobenius = 0;
    int corner[3] = {cell[0], cell[1], cell[2]};
    Vec3d last = table.at(corner[0], corner[1], corner[2]).Cast<double>();
    for (const int axis : order) {
      ++corner[axis];
      const Vec3d next = table.at(corner[0], corner[1], corner[2]).Cast<double>();
      for (int c = 0; c < 3; ++c) {
        slope(c, axis) = (next[c] - last[c]) / side[axis];
        frobenius += slope(c, axis) * slope(c, axis);
      }
      last = next;
    }
    // The Frobenius norm is never below the largest singular value: most are passed over.
    if (frobenius > largest * largest) largest = std::max(largest, LargestSingularValue(slope));
  }
  return largest;
}

}  // namespace

TableStencil StencilOf(const ColorTable& table, const Vec3d& color) {
  const int size = table.size;
  size_t vertex = 0, step[3] = {1, static_cast<size_t>(size), static_cast<size_t>(size) * size};
  Vec3d f;
  for (int a = 0; a < 3; ++a) {
    const double place =
        std::clamp((color[a] - table.low[a]) / (table.high[a] - table.low[a]), 0.0, 1.0) *
        static_cast<double>(size - 1);
    const int corner = std::min(static_cast<int>(place), size - 2);
    vertex += static_cast<size_t>(corner) * step[a];
    f[a] = place - corner;
  }
  int order[3] = {0, 1, 2};
  if (f[order[0]] < f[order[1]]) std::swap(order[0], order[1]);
  if (f[order[1]] < f[order[2]]) std::swap(order[1], order[2]);
  if (f[order[0]] < f[order[1]]) std::swap(order[0], order[1]);
  TableStencil stencil{{vertex, 0, 0, 0}, {1 - f[order[0]], 0, 0, 0}};
  for (int i = 0; i < 3; ++i) {
    stencil.vertex[i + 1] = vertex += step[order[i]];
    stencil.weight[i + 1] = f[order[i]] - (i < 2 ? f[order[i + 1]] : 0);
  }
  return stencil;
}

Vec3d ColorTable::operator()(const Vec3d& color) const {
  const TableStencil stencil = StencilOf(*this, color);
  Vec3d result;
  for (int i = 0; i < 4; ++i)
    result += values[stencil.vertex[i]].Cast<double>() * stencil.weight[i];
  return result;
}

Vec3d ColorCurves::operator()(const Vec3d& color) const {
  const size_t last = values.size() - 1;
  Vec3d result;
  for (int c = 0; c < 3; ++c) {
    const double place = std::clamp((color[c] - low[c]) / (high[c] - low[c]), 0.0, 1.0) *
                         static_cast<double>(last);
    const size_t i = std::min(static_cast<size_t>(place), last - 1);
    const double f = place - static_cast<double>(i);
    result[c] = (1 - f) * double{values[i][c]} + f * double{values[i + 1][c]};
  }
  return result;
}

double SteepestSlope(const ColorCurves& curves) {
  double largest = 0;
  const double steps = static_cast<double>(curves.values.size() - 1);
  for (size_t i = 0; i + 1 < curves.values.size(); ++i)
    for (int c = 0; c < 3; ++c)
      largest = std::max(
          largest, std::abs(double{curves.values[i + 1][c]} - double{curves.values[i][c]}) *
                       steps / (curves.high[c] - curves.low[c]));
  return largest;
}

ColorTable TabulateColors(int size, const std::function<Vec3d(const Vec3d&)>& map) {
  REGRADE_CHECK(size >= 2);
  ColorTable table;
  table.size = size;
  table.values.resize(static_cast<size_t>(size) * size * size);
  const double last = size - 1;
#pragma omp parallel for schedule(static)
  for (int b = 0; b < size; ++b)
    for (int g = 0; g < size; ++g)
      for (int r = 0; r < size; ++r)
        table.values[static_cast<size_t>((b * size + g) * size + r)] =
            map({r / last, g / last, b / last}).Cast<float>();
  return table;
}

double SteepestSlope(const ColorTable& table, double enough) {
  REGRADE_CHECK(table.size >= 2);
  const Vec3d side = (table.high - table.low) / static_cast<double>(table.size - 1);
  double largest = 0;
  for (int b = 0; b + 1 < table.size && largest <= enough; ++b)
    for (int g = 0; g + 1 < table.size; ++g)
      for (int r = 0; r + 1 < table.size; ++r)
        largest = SteepestInCell(table, {r, g, b}, side, largest);
  return largest;
}

}  // namespace regrade
