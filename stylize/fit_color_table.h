// A table of colours fitted to pairs of colours: a style as a LUT.
#pragma once

#include "kernels/image/color_table.h"
#include "stylize/linear_map.h"

namespace regrade {

// EQ(table-fit): over the values v of a table, interpolated, see EQ(color-table),
//   min sum_j |T_v(s_j) - t_j|^2 + lambda sum over edges (p, q) |(v_p - A p) - (v_q - A q)|^2,
// A the least-squares linear map of all pairs: where no source colour lies, the table goes on
// as that map, smoothly. lambda is `smoothness` times the number of pairs for each vertex.
// Solved by conjugate gradients. Sources are in [0, 1]; the values are clipped to [0, 1].
class TableFit {
 public:
  explicit TableFit(int size);  // at least 2
  void Add(const Vec3d& source, const Vec3d& target);
  ColorTable Solve(double smoothness = 1e-3) const;

 private:
  int size_;
  std::vector<Vec3d> sources_, targets_;
  LeastSquaresAccumulator linear_;
};

}  // namespace regrade
