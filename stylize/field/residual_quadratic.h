// A quadratic that touches the energy of a residual by voxel from above, its matrix and its
// preconditioner.
#pragma once

#include <cstdint>
#include <vector>

#include "stylize/field/residual_rays.h"
#include "stylize/field/voxel_graph.h"

namespace regrade {

// Half of sum_r m |W x - t|^2 + sum_{u ~ v} w_uv |x_u - x_v|^2 + e sum |x|^2, symbols as in
// EQ(voxel-residual). Both arguments stay with the caller.
class ResidualQuadratic {
 public:
  ResidualQuadratic(const VoxelGraph& graph, const ResidualRays& rays, double pull);

  // Where the total variation of x, of that cost and width, is touched: w = cost k / sqrt(...).
  void TouchAt(const std::vector<Vec3d>& x, double cost, double width);

  // W^T (m y)
  std::vector<Vec3d> Adjoint(const std::vector<Vec3d>& y) const;
  // The matrix times x.
  std::vector<Vec3d> Apply(const std::vector<Vec3d>& x) const;
  // sum over levels of P D^-1 P^T r, P what is constant in each cube, D about the diagonal of
  // P^T (matrix) P; level 0 are the voxels themselves.
  std::vector<Vec3d> Precondition(const std::vector<Vec3d>& r) const;

 private:
  void FindDiagonals();

  const VoxelGraph& graph_;
  const ResidualRays& rays_;
  double pull_;
  // W, by voxels.
  std::vector<int64_t> first_;
  std::vector<int32_t> ray_;
  std::vector<float> weight_;
  std::vector<std::vector<int32_t>> parent_;  // of each level's cubes, that of the next level
  std::vector<double> edge_;                  // w
  std::vector<std::vector<double>> inverse_;  // D^-1 of the voxels, then of each level's cubes
};

}  // namespace regrade
