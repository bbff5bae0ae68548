// Colours as a mixture of Gaussians, fitted by expectation maximisation.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/vec.h"

namespace regrade {

struct GaussianPart {
  double weight = 0;  // of the mixture; they sum to 1
  Vec3d mean{};
  Mat3d covariance;     // eigenvalues at least kPartVarianceFloor
  double height = 0.5;  // mean of its colours in their pictures, 0 at the bottom, 1 at the top
};
using GaussianMixture = std::vector<GaussianPart>;

// A part is never thinner than two steps of 8 bits.
inline constexpr double kPartVarianceFloor = (2.0 / 255) * (2.0 / 255);
inline constexpr int64_t kMixtureSample = 1 << 14;  // colours that a mixture is fitted to

// EQ(gaussian-mixture): with the share r_ik of part k in colour x_i,
//   r_ik = w_k N(x_i; m_k, S_k) / sum_j w_j N(x_i; m_j, S_j),
// each iteration sets w_k, m_k and S_k to the weight, mean and covariance of the colours
// weighted by r_ik (Dempster, Laird and Rubin 1977), eigenvalues of S_k raised to the floor.
//
// Starts from k-means++ (Arthur and Vassilvitskii 2007) on `seed`. There are fewer than `parts`
// where the colours have fewer clusters wider than the floor, and a part that no colour
// belongs to is left out. Ends before an iteration that gains less than 1e-5 nats a colour. The
// same for any number of threads. `colors` is not empty, and finite.
GaussianMixture FitMixture(const std::vector<Vec3d>& colors, int parts, uint64_t seed);

// `prior` carried over to other colours: its parts, which keep their order and their heights,
// count as kPriorShare of the colours, so that none gets lost where few colours belong to it.
inline constexpr double kPriorShare = 0.02;
GaussianMixture AdaptMixture(const GaussianMixture& prior, const std::vector<Vec3d>& colors);

// Sets each part's height to the mean of `heights`, those of `colors`, weighted by r_ik.
void MeasureHeights(const std::vector<Vec3d>& colors, const std::vector<double>& heights,
                    GaussianMixture* mixture);

// The covariance with its eigenvalues raised to `least`.
Mat3d WidenedCovariance(const Mat3d& covariance, double least);

}  // namespace regrade
