// The Monge-Kantorovich linear colour map (MKL): moves one normal distribution of colours onto
// another with the least squared change of colours.
#pragma once

#include <string>
#include <vector>

#include "kernels/image/color_statistics.h"
#include "stylize/linear_map.h"

namespace regrade {

struct MklMap {
  ColorMap map;     // c -> T c + b, b = style mean - T source mean; T symmetric, >= 0
  double norm = 0;  // K_est = ||T||_2
  int rank = 0;     // directions that T carries: eigenvalues above 1e-9 of the norm
  std::vector<std::string> notices;  // what a person should know, one sentence each
};

inline constexpr char kFlatStyleNotice[] =
    "the style image has a single colour: the result will be flat";
inline constexpr double kLargestUsualNorm = 1e3;  // beyond it, a notice

// EQ(mkl), Pitie and Kokaram 2007, LipRF eq. 11. Source covariance A, style covariance B. Of
//   T = A^-1/2 (A^1/2 B A^1/2)^1/2 A^-1/2 = B^1/2 (B^1/2 A B^1/2)^-1/2 B^1/2
// the second, dual form is used, for it survives a singular A. With s = RankWeight(A / tau), a
// function of the matrix A, and G = B^1/2 (s A)^1/2 = P S Q^T,
//   T = L F L^T,  L = B^1/2 P S^-1/2 (columns of S = 0 are 0),  F = Q^T s^3/2 Q.
// Where s = 1 this is the dual form with the pseudo-inverse of its inner root P S P^T. On the
// colours of a grey photo, A = l u u^T, it is the limit of the ridge solution, T u = B u /
// sqrt(l u^T B u), and bounded elsewhere. (The primal form with a pseudo-inverse would keep
// only its part along u and lose the tint.)
//
// s is the rank rule: variances of A below tau = kRoundingVariance are rounding noise and count
// as 0, those above 100 tau in full; one between, alone in its direction, gives s / sqrt(a b).
// As s belongs to A and not to single eigenvectors of the inner root, T is continuous in A also
// where those cross. A cut would make T jump from one frame to the next, and a ridge would give
// a grey photo a norm in the hundreds.
//
// In sRGB values, as in the paper. Statistics that are not finite, or not a covariance, fail a
// check.
MklMap ComputeMkl(const ColorStatistics& source, const ColorStatistics& style);

// EQ(rank-weight): 0 up to x = 1, 1 from x = 100, (t^2 (3 - 2t))^2 with t = log_100 x between.
double RankWeight(double x);

}  // namespace regrade
