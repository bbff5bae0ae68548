#include "stylize/image/part_density.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"

namespace regrade {

std::vector<PartDensity> DensitiesOf(const GaussianMixture& mixture, double least) {
  std::vector<PartDensity> densities;
  for (const GaussianPart& part : mixture) {
    const Mat3d covariance = WidenedCovariance(part.covariance, least);
    Eigen::Matrix3d s;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) s(i, j) = covariance(i, j);
    const Eigen::LLT<Eigen::Matrix3d> cholesky(s);
    REGRADE_CHECK(cholesky.info() == Eigen::Success);
    const Eigen::Matrix3d lower = cholesky.matrixL();
    const Eigen::Matrix3d inverse =
        lower.triangularView<Eigen::Lower>().solve(Eigen::Matrix3d::Identity());
    PartDensity density;
    density.log_scale = std::log(part.weight) - lower.diagonal().array().log().sum();
    density.mean = part.mean;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) density.whitening(i, j) = inverse(i, j);
    densities.push_back(density);
  }
  return densities;
}

double SharesOf(const std::vector<PartDensity>& parts, const Vec3d& color, double* shares) {
  constexpr double kNothing = -40;  // exp(-40) is below the rounding of the sum
  double largest = -1e300;
  for (size_t k = 0; k < parts.size(); ++k) {
    const PartDensity& part = parts[k];
    const Vec3d d = color - part.mean;
    const Vec3d w = part.whitening * d;
    shares[k] = part.log_scale - 0.5 * Dot(w, w);
    largest = std::max(largest, shares[k]);
  }
  // The largest share is exp(0) before it is divided: the sum is at least 1.
  double sum = 0;
  for (size_t k = 0; k < parts.size(); ++k) {
    const double below = shares[k] - largest;
    shares[k] = below < kNothing ? 0 : std::exp(below);
    sum += shares[k];
  }
  for (size_t k = 0; k < parts.size(); ++k) shares[k] /= sum;
  return largest + std::log(sum);
}

}  // namespace regrade
