#include "evaluate/feature_statistics.h"

#include <Eigen/Dense>
#include <algorithm>

#include "kernels/base/error.h"

namespace regrade {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using MatrixView = Eigen::Map<const Matrix>;
using VectorView = Eigen::Map<const Eigen::VectorXd>;

// Of a covariance; what rounding makes negative is 0.
Eigen::VectorXd RootsOf(const Eigen::VectorXd& eigenvalues) {
  return eigenvalues.cwiseMax(0).cwiseSqrt();
}

}  // namespace

FeatureStatistics::FeatureStatistics(const std::vector<float>& features, int channels) {
  REGRADE_CHECK(channels > 0 && features.size() % static_cast<size_t>(channels) == 0);
  count_ = std::ssize(features) / channels;
  if (count_ == 0) return;
  Matrix centred =
      Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
          features.data(), channels, count_)
          .cast<double>();
  const Eigen::VectorXd mean = centred.rowwise().mean();
  centred.colwise() -= mean;
  const Matrix scatter = centred * centred.transpose();
  mean_.assign(mean.data(), mean.data() + mean.size());
  scatter_.assign(scatter.data(), scatter.data() + scatter.size());
}

FeatureStatistics& FeatureStatistics::operator+=(const FeatureStatistics& o) {
  if (o.count_ == 0) return *this;
  if (count_ == 0) return *this = o;
  REGRADE_CHECK_EQ(channels(), o.channels());
  const size_t size = mean_.size();
  const double total = static_cast<double>(count_ + o.count_);
  const double own = static_cast<double>(count_) / total,
               other = static_cast<double>(o.count_) / total;
  std::vector<double> apart(size);
  for (size_t i = 0; i < size; ++i) apart[i] = o.mean_[i] - mean_[i];
  for (size_t i = 0; i < size; ++i)
    for (size_t j = 0; j < size; ++j)
      scatter_[i * size + j] +=
          o.scatter_[i * size + j] + own * other * total * apart[i] * apart[j];
  for (size_t i = 0; i < size; ++i) mean_[i] += other * apart[i];
  count_ += o.count_;
  return *this;
}

double GramDistance(const FeatureStatistics& a, const FeatureStatistics& b) {
  REGRADE_CHECK(a.count_ > 0 && b.count_ > 0);
  REGRADE_CHECK_EQ(a.channels(), b.channels());
  const size_t size = a.mean_.size();
  const auto gram = [size](const FeatureStatistics& s, size_t i, size_t j) {
    return s.scatter_[i * size + j] / static_cast<double>(s.count_) + s.mean_[i] * s.mean_[j];
  };
  double sum = 0;
  for (size_t i = 0; i < size; ++i)
    for (size_t j = 0; j < size; ++j) {
      const double difference = gram(a, i, j) - gram(b, i, j);
      sum += difference * difference;
    }
  return sum / (4.0 * static_cast<double>(size * size));
}

double FrechetDistance(const FeatureStatistics& a, const FeatureStatistics& b) {
  REGRADE_CHECK(a.count_ > 0 && b.count_ > 0);
  REGRADE_CHECK_EQ(a.channels(), b.channels());
  const int size = a.channels();
  const auto covariance = [size](const FeatureStatistics& s) -> Matrix {
    return MatrixView(s.scatter_.data(), size, size) / static_cast<double>(s.count_);
  };
  const Matrix of_a = covariance(a), of_b = covariance(b);
  const double means =
      (VectorView(a.mean_.data(), size) - VectorView(b.mean_.data(), size)).squaredNorm();
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(of_a);
  const Matrix root = eigen.eigenvectors() * RootsOf(eigen.eigenvalues()).asDiagonal() *
                      eigen.eigenvectors().transpose();
  const Matrix inner = root * of_b * root;
  const Matrix symmetric = (inner + inner.transpose()) / 2;  // up to rounding it is
  const Eigen::SelfAdjointEigenSolver<Matrix> both(symmetric, Eigen::EigenvaluesOnly);
  return std::max(0.0,
                  means + of_a.trace() + of_b.trace() - 2 * RootsOf(both.eigenvalues()).sum());
}

}  // namespace regrade
