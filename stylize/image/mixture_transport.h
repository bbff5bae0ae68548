// Optimal transport between mixtures of Gaussians, as a map of colours.
#pragma once

#include <vector>

#include "stylize/image/gaussian_mixture.h"
#include "stylize/image/part_density.h"
#include "stylize/linear_map.h"

namespace regrade {

// EQ(mixture-transport), Delon and Desolneux 2020. Between parts with means m, n and
// covariances S, R, the map of least squared change, and what it costs, are
//   T_kl(x) = n_l + A (x - m_k),  A = S^-1/2 (S^1/2 R S^1/2)^1/2 S^-1/2,
//   c_kl = |m_k - n_l|^2 + tr(S) + tr(R) - 2 tr((S^1/2 R S^1/2)^1/2) + h^2 (v_k - u_l)^2,
// with v and u the parts' heights in their pictures and h = height_weight, 0 in the paper.
// With the cheapest plan w_kl between the parts' weights (see EQ(transport-plan)) and the
// shares r_k(x) of the source's parts (see EQ(gaussian-mixture)),
//   T(x) = sum_k r_k(x) sum_l w_kl / w_k T_kl(x).
//
// Thin parts are steep in their A, and between distant parts r_k(x) may be arbitrarily steep.
// So that the slope on a table of 33^3 colours stays below `max_slope`, a part's eigenvalues
// are raised first, until its own map has at most 4/5 of it, and then those of all parts in
// r_k, where they make the shares smoother. Without that need T is as above.
struct MixtureMap {
  std::vector<PartDensity> densities;  // of the source
  std::vector<ColorMap> maps;          // sum_l w_kl / w_k T_kl for each k
  double slope = 0;                    // steepest, on a table of kSlopeTable^3 colours
  double slope_before = 0;             // of the map before parts were widened; at least
  Vec3d operator()(const Vec3d& color) const;
};

inline constexpr int kSlopeTable = 33;
inline constexpr int kMostParts = 16;

// Both have between 1 and kMostParts parts; max_slope > 0, height_weight >= 0.
MixtureMap ComputeMixtureMap(const GaussianMixture& source, const GaussianMixture& style,
                             double max_slope, double height_weight = 0);

}  // namespace regrade
