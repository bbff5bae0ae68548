#include "stylize/image/region_mixture.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/base/random.h"

namespace regrade {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Vector = Eigen::VectorXd;

constexpr int kMostRegionIterations = 60;
constexpr double kLeastRegionGain = 1e-4;  // nats a row

Eigen::Map<const Matrix> CovarianceOf(const RegionPart& part) {
  const auto n = static_cast<Eigen::Index>(part.mean.size());
  return {part.covariance.data(), n, n};
}

// Columns are rows of the features: [dimensions, rows].
Eigen::MatrixXd ColumnsOf(const FeatureRows& rows) {
  return Eigen::Map<const Eigen::MatrixXf>(rows.values.data(), rows.dimensions, rows.rows())
      .cast<double>();
}

// A symmetric matrix's eigenvalues raised to `least`, to a power.
Matrix Raised(const Matrix& given, double least, double exponent) {
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(given);
  REGRADE_CHECK(solver.info() == Eigen::Success);
  const Vector values = solver.eigenvalues().cwiseMax(least).array().pow(exponent);
  return solver.eigenvectors() * values.asDiagonal() * solver.eigenvectors().transpose();
}

RegionPart PartOf(double weight, const Vector& mean, const Matrix& covariance) {
  const Matrix wide = Raised((covariance + covariance.transpose()) / 2, kPartFloor, 1);
  return {weight,
          {mean.data(), mean.data() + mean.size()},
          {wide.data(), wide.data() + wide.size()}};
}

// Of columns weighted by column k of `shares` [rows, parts]; parts without rows are left out.
RegionMixture Maximised(const Eigen::MatrixXd& x, const Eigen::MatrixXd& shares) {
  constexpr double kEmpty = 1e-6;  // of all rows
  RegionMixture mixture;
  double kept = 0;
  for (Eigen::Index k = 0; k < shares.cols(); ++k) {
    const double count = shares.col(k).sum();
    if (count <= kEmpty * static_cast<double>(x.cols())) continue;
    const Vector mean = x * shares.col(k) / count;
    const Eigen::MatrixXd d = x.colwise() - mean;
    const Eigen::MatrixXd weighted = d * shares.col(k).asDiagonal();
    mixture.push_back(PartOf(count, mean, weighted * d.transpose() / count));
    kept += count;
  }
  for (RegionPart& part : mixture) part.weight /= kept;
  return mixture;
}

// r_ik [rows, parts]; returns the mean log density of a row, without the constant of all
// Gaussians.
double Expect(const RegionMixture& mixture, const Eigen::MatrixXd& x, Eigen::MatrixXd* shares) {
  shares->resize(x.cols(), std::ssize(mixture));
  for (Eigen::Index k = 0; k < shares->cols(); ++k) {
    const RegionPart& part = mixture[static_cast<size_t>(k)];
    const Eigen::LLT<Eigen::MatrixXd> cholesky(CovarianceOf(part));
    REGRADE_CHECK(cholesky.info() == Eigen::Success);
    const Eigen::MatrixXd lower = cholesky.matrixL();
    const Eigen::MatrixXd d =
        x.colwise() - Eigen::Map<const Vector>(part.mean.data(), x.rows());
    const double scale = std::log(part.weight) - lower.diagonal().array().log().sum();
    shares->col(k) =
        (scale -
         0.5 * lower.triangularView<Eigen::Lower>().solve(d).colwise().squaredNorm().array())
            .matrix()
            .transpose();
  }
  // The largest share is exp(0) before it is divided: the sum is at least 1.
  const Vector largest = shares->rowwise().maxCoeff();
  *shares = (shares->colwise() - largest).array().max(-700.0).exp();
  const Vector sum = shares->rowwise().sum();
  *shares = sum.cwiseInverse().asDiagonal() * *shares;
  return (largest.array() + sum.array().log()).mean();
}

// [rows, parts]: 1 for the nearest of so many rows that are far from each other, each drawn
// with the squared distance to those before it.
Eigen::MatrixXd FirstShares(const Eigen::MatrixXd& x, int parts, uint64_t seed) {
  constexpr uint64_t kStream = 0x7265;
  const auto to = [&x](Eigen::Index row) -> Vector {
    return (x.colwise() - x.col(row)).colwise().squaredNorm().transpose();
  };
  std::vector<Vector> squared = {to(static_cast<Eigen::Index>(
      RandomIndex(seed, kStream, 0, static_cast<uint64_t>(x.cols()))))};
  Vector least = squared[0];
  while (std::ssize(squared) < parts && least.maxCoeff() > kPartFloor) {
    double place = least.sum() * RandomDouble(seed, kStream, squared.size());
    Eigen::Index drawn = 0;
    while (drawn + 1 < x.cols() && (place -= least[drawn]) >= 0) ++drawn;
    squared.push_back(to(drawn));
    least = least.cwiseMin(squared.back());
  }
  Eigen::MatrixXd shares = Eigen::MatrixXd::Zero(x.cols(), std::ssize(squared));
  for (Eigen::Index i = 0; i < x.cols(); ++i) {
    Eigen::Index nearest = 0;
    for (Eigen::Index k = 1; k < shares.cols(); ++k)
      if (squared[static_cast<size_t>(k)][i] < squared[static_cast<size_t>(nearest)][i])
        nearest = k;
    shares(i, nearest) = 1;
  }
  return shares;
}

}  // namespace

RegionMixture FitRegions(const FeatureRows& rows, int parts, uint64_t seed) {
  REGRADE_CHECK(rows.rows() > 0 && parts >= 1);
  const Eigen::MatrixXd x = ColumnsOf(rows);
  Eigen::MatrixXd shares = FirstShares(x, parts, seed);
  RegionMixture mixture = Maximised(x, shares);
  double likelihood = Expect(mixture, x, &shares);
  for (int i = 0; i < kMostRegionIterations; ++i) {
    mixture = Maximised(x, shares);
    const double then = Expect(mixture, x, &shares);
    if (!(then - likelihood >= kLeastRegionGain)) break;
    likelihood = then;
  }
  return mixture;
}

std::vector<float> RegionShares(const RegionMixture& mixture, const FeatureRows& rows) {
  Eigen::MatrixXd shares;
  Expect(mixture, ColumnsOf(rows), &shares);
  const Eigen::MatrixXf by_part = shares.transpose().cast<float>();
  return {by_part.data(), by_part.data() + by_part.size()};
}

double PartDistance(const RegionPart& a, const RegionPart& b) {
  REGRADE_CHECK_EQ(a.mean.size(), b.mean.size());
  const auto n = static_cast<Eigen::Index>(a.mean.size());
  const Vector d =
      Eigen::Map<const Vector>(a.mean.data(), n) - Eigen::Map<const Vector>(b.mean.data(), n);
  const Matrix root = Raised(CovarianceOf(a), 0, 0.5);
  const Matrix between = root * CovarianceOf(b) * root;
  const double shared = Raised((between + between.transpose()) / 2, 0, 0.5).trace();
  // Rounding may leave a little less than nothing between equal parts.
  return d.squaredNorm() +
         std::max(0.0, CovarianceOf(a).trace() + CovarianceOf(b).trace() - 2 * shared);
}

}  // namespace regrade
