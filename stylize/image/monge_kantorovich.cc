#include "stylize/image/monge_kantorovich.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/base/error.h"

namespace regrade {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// f of a covariance: f is applied to the eigenvalues.
template <typename Function>
Matrix3d MatrixFunction(const EigenSystem& eigen, const Function& f) {
  Matrix3d vectors;
  Vector3d values;
  for (int i = 0; i < 3; ++i) {
    values(i) = f(eigen.values[i]);
    for (int j = 0; j < 3; ++j) vectors(i, j) = eigen.vectors(i, j);
  }
  return vectors * values.asDiagonal() * vectors.transpose();
}

Matrix3d Transport(const EigenSystem& source, const EigenSystem& style) {
  const auto root = [](double value) { return std::sqrt(value); };
  const auto weight = [](double value) { return RankWeight(value / kRoundingVariance); };
  const auto weighted_root = [&](double value) { return std::sqrt(value * weight(value)); };
  const auto residual_weight = [&](double value) { return std::pow(weight(value), 1.5); };
  const Matrix3d style_root = MatrixFunction(style, root);
  const Matrix3d g = style_root * MatrixFunction(source, weighted_root);
  const Eigen::JacobiSVD<Matrix3d> svd(g, Eigen::ComputeFullU | Eigen::ComputeFullV);
  // Singular values within rounding of ||B^1/2|| ||A^1/2|| are 0: the supports are orthogonal.
  const double rounding =
      64 * std::numeric_limits<double>::epsilon() * std::sqrt(source.values.z * style.values.z);
  Vector3d inverse_root;
  for (int i = 0; i < 3; ++i) {
    const double s = svd.singularValues()(i);
    inverse_root(i) = s > rounding ? 1 / std::sqrt(s) : 0;
  }
  const Matrix3d l = style_root * svd.matrixU() * inverse_root.asDiagonal();
  const Matrix3d f =
      svd.matrixV().transpose() * MatrixFunction(source, residual_weight) * svd.matrixV();
  const Matrix3d t = l * f * l.transpose();
  return 0.5 * (t + t.transpose());
}

}  // namespace

double RankWeight(double x) {
  const double t = std::clamp(std::log(std::max(x, 1.0)) / std::log(100.0), 0.0, 1.0);
  const double smooth = t * t * (3 - 2 * t);
  return smooth * smooth;
}

MklMap ComputeMkl(const ColorStatistics& source, const ColorStatistics& style) {
  REGRADE_CHECK(AllFinite(source.mean) && AllFinite(style.mean));
  const EigenSystem a = CovarianceEigen(source.covariance);
  const EigenSystem b = CovarianceEigen(style.covariance);
  const Matrix3d t = Transport(a, b);
  MklMap result;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) result.map.matrix(i, j) = t(i, j);
  result.map.offset = style.mean - result.map.matrix * source.mean;

  const EigenSystem eigen = SymmetricEigen(result.map.matrix);
  result.norm = std::max(std::abs(eigen.values.x), std::abs(eigen.values.z));
  for (int i = 0; i < 3; ++i)
    if (eigen.values[i] > 1e-9 * result.norm) ++result.rank;

  if (b.values.z <= kRoundingVariance) {
    result.notices.push_back(kFlatStyleNotice);
  } else if (a.values.z <= kRoundingVariance) {
    result.notices.push_back("the photo has a single colour: it gets the style's mean colour");
  } else if (a.values.x <= kRoundingVariance) {
    result.notices.push_back(a.values.y <= kRoundingVariance
                                 ? "the photo's colours lie on a line (a grey photo?): colours "
                                   "beyond it are not defined by the style"
                                 : "the photo's colours lie in a plane: colours beyond it are "
                                   "not defined by the style");
  }
  if (result.norm > kLargestUsualNorm) {
    result.notices.push_back(
        Format("the colour map magnifies differences %.3g times", result.norm));
  }
  return result;
}

}  // namespace regrade
