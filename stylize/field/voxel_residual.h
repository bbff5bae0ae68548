// A residual by voxel: what a styled field lacks to pictures, where no function of colour and
// position of few parameters carries it, such as the edit of one object or of one side.
//
// EQ(voxel-residual): of the constant colours x_v that are added to the voxels, those that
// minimise
//   E(x) = sum_r m |sum_v W_rv x_v - t_r|^2 + 2 p sum_{u ~ v} k_uv (sqrt(|x_u - x_v|^2 + d^2) -
//   d)
//          + e sum_v |x_v|^2
// over rays r with the weight W_rv = sum_i w_i b_iv with which they see voxel v (see
// EQ(mask-vote)); t_r is what the styled field lacks to the picture, m a ray's share of the
// pixels. The second term is the cost of a residual, its total variation over neighbours u ~ v,
// d = 0.01 of white what counts as no difference; k_uv = 0.1 + exp(-|c_u - c_v|^2 / (2 s^2)),
// s = 0.2, is less between voxels of different colours c: an edit ends where colours change,
// and places that no picture sees follow their neighbours of like colour. e = 1e-6 leaves parts
// that know nothing at 0. Of splats W_rv is w_v (see EQ(splat-composite)), and neighbours are
// the nearest, see GraphOf.
//
// The clamp of a sample's colour at black is not part of E; where x keeps colours from 0 to 1,
// see BoundsOfColors, it has nothing to do. A constant added at a voxel changes no slope
// of the map of coefficients there: EQ(liprf-bound) holds for network and residual as for the
// network. That of a neighbour may be another: the bound says nothing of two positions.
//
// E is convex. It is minimised by quadratics that touch it from above (weights p k /
// sqrt(...)), each by conjugate gradients; the preconditioner adds the diagonals of the cubes
// of 2 to 64 voxels, so that places far from all rays are reached in few steps. Bounds are kept
// by projection: what lies at one, and would leave, is held for a quadratic.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/progress.h"
#include "stylize/field/residual_rays.h"
#include "stylize/field/voxel_graph.h"

namespace regrade {

struct ResidualOptions {
  double cost = 0.01;   // p
  double width = 0.01;  // d
  double pull = 1e-6;   // e
  int turns = 6;        // quadratics
  int steps = 15;       // of conjugate gradients for each
};

// E, and its gradient [voxels] unless null: the plain specification.
double ResidualEnergy(const VoxelGraph& graph, const ResidualRays& rays,
                      const ResidualOptions& options, const std::vector<Vec3d>& x,
                      std::vector<Vec3d>* gradient);

// Of x, each [voxels]; both empty for none.
struct ResidualBounds {
  std::vector<Vec3d> least, most;
};

// For colours that are added to an appearance: its own stay in [0, 1], or where they are.
ResidualBounds BoundsOfColors(const Appearance& appearance);

// [voxels]. The same for any number of threads. `start`: [voxels], or empty for 0.
std::vector<Vec3d> FitResidual(const VoxelGraph& graph, const ResidualRays& rays,
                               const ResidualOptions& options, const ResidualBounds& bounds,
                               std::vector<Vec3d> start = {},
                               const ProgressFunction& progress = nullptr);

// A residual as it is applied: to a voxel's coefficients s of channel c
//
// EQ(view-scale): s_0 += x_c / Gamma_0, s_k *= rho_c for k > 0, rho_c = clamp(1 + x_c /
// max(a, 0.02), 0, 1), a = 1/2 + Gamma_0 s_0 the colour before. What changes with the view
// keeps its proportion to a colour that is darkened, as under less light, and never grows: rho
// <= 1 keeps EQ(liprf-bound).
struct VoxelResidual {
  std::vector<Vec3f> color;       // [voxels]: x
  std::vector<Vec3f> view_scale;  // [voxels]: rho; empty where it is 1
};

// rho of colours that are added to an appearance.
std::vector<Vec3f> ViewScale(const Appearance& appearance, const std::vector<Vec3d>& color);

void AddResidual(const VoxelResidual& residual, Appearance* appearance);

}  // namespace regrade
