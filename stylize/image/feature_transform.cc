#include "stylize/image/feature_transform.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"

namespace regrade {
namespace {

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using RowMatrixF = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr int64_t kBlock = 4096;  // pixels taken to double at a time

Eigen::Map<const RowMatrixF> RowsOf(const FeatureMap& f) {
  return {f.values.data(), f.channels, f.num_pixels()};
}
Eigen::Map<const RowMatrix> SquareOf(const std::vector<double>& m, int n) {
  return {m.data(), n, n};
}
Eigen::Map<const Eigen::VectorXd> VectorOf(const std::vector<double>& v) {
  return {v.data(), static_cast<Eigen::Index>(v.size())};
}
std::vector<double> Stored(const RowMatrix& m) { return {m.data(), m.data() + m.size()}; }

RowMatrix Power(const FeatureStatistics& statistics, const WhiteningRule& rule,
                double exponent) {
  const RowMatrix given = SquareOf(statistics.covariance, statistics.channels);
  // An infinity passes the solver as a success.
  REGRADE_CHECK(given.allFinite());
  const Eigen::SelfAdjointEigenSolver<RowMatrix> solver((given + given.transpose()) / 2);
  REGRADE_CHECK(solver.info() == Eigen::Success);
  Eigen::VectorXd values = solver.eigenvalues();
  for (double& value : values) {
    value = std::max(value, 0.0) + rule.ridge;
    value = value > rule.drop ? std::pow(value, exponent) : 0;
  }
  return solver.eigenvectors() * values.asDiagonal() * solver.eigenvectors().transpose();
}

// The factor of a covariance, or of one that is regular enough.
RowMatrix CholeskyFactor(const FeatureStatistics& statistics) {
  constexpr double kRidge = 2e-5;
  // Of the largest variance: below it, a pivot is rounding.
  constexpr double kSingular = 1e-13;
  RowMatrix given = SquareOf(statistics.covariance, statistics.channels);
  REGRADE_CHECK(given.allFinite());
  given = (given + given.transpose()).eval() / 2;
  for (int more = 0;; ++more) {
    if (more > 0) given.diagonal().array() += more * kRidge;
    const Eigen::LLT<Eigen::MatrixXd> cholesky(given);
    if (cholesky.info() != Eigen::Success) continue;
    const RowMatrix lower = cholesky.matrixL();
    const double least = lower.diagonal().minCoeff();
    if (least * least > kSingular * given.diagonal().maxCoeff()) return lower;
  }
}

}  // namespace

FeatureStatistics MeasureFeatures(const FeatureMap& features, int fewer) {
  const auto view = RowsOf(features);
  const int64_t count = features.num_pixels();
  REGRADE_CHECK_GT(count, 0);
  const int n = features.channels;
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(n);
  for (int64_t i = 0; i < count; i += kBlock)
    mean += view.middleCols(i, std::min(kBlock, count - i)).cast<double>().rowwise().sum();
  mean /= static_cast<double>(count);
  RowMatrix sum = RowMatrix::Zero(n, n);
  for (int64_t i = 0; i < count; i += kBlock) {
    const RowMatrix centred =
        view.middleCols(i, std::min(kBlock, count - i)).cast<double>().colwise() - mean;
    sum.noalias() += centred * centred.transpose();
  }
  sum /= static_cast<double>(std::max<int64_t>(1, count - fewer));
  return {n, {mean.data(), mean.data() + n}, Stored(sum)};
}

FeatureAffine WhitenAndColor(const FeatureStatistics& content, const FeatureStatistics& style,
                             const WhiteningRule& rule, double strength) {
  REGRADE_CHECK_EQ(content.channels, style.channels);
  const int n = content.channels;
  RowMatrix a = Power(style, rule, 0.5) * Power(content, rule, -0.5);
  a = strength * a + (1 - strength) * RowMatrix::Identity(n, n);
  const Eigen::VectorXd from = VectorOf(content.mean), to = VectorOf(style.mean);
  const Eigen::VectorXd offset = strength * to + (1 - strength) * from - a * from;
  REGRADE_CHECK(a.allFinite() && offset.allFinite());
  return {n, Stored(a), {offset.data(), offset.data() + n}};
}

FeatureAffine CholeskyColor(const FeatureStatistics& content, const FeatureStatistics& style) {
  REGRADE_CHECK_EQ(content.channels, style.channels);
  const int n = content.channels;
  const RowMatrix of_content = CholeskyFactor(content), of_style = CholeskyFactor(style);
  const RowMatrix a =
      of_style *
      of_content.triangularView<Eigen::Lower>().solve(RowMatrix::Identity(n, n)).eval();
  const Eigen::VectorXd offset = VectorOf(style.mean) - a * VectorOf(content.mean);
  REGRADE_CHECK(a.allFinite() && offset.allFinite());
  return {n, Stored(a), {offset.data(), offset.data() + n}};
}

void Apply(const FeatureAffine& affine, FeatureMap* features) {
  REGRADE_CHECK_EQ(affine.channels, features->channels);
  const int64_t count = features->num_pixels();
  const auto a = SquareOf(affine.matrix, affine.channels);
  const auto offset = VectorOf(affine.offset);
  Eigen::Map<RowMatrixF> view(features->values.data(), features->channels, count);
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < count; i += kBlock) {
    auto block = view.middleCols(i, std::min(kBlock, count - i));
    const RowMatrix mapped = (a * block.cast<double>()).colwise() + offset;
    block = mapped.cast<float>();
  }
}

}  // namespace regrade
