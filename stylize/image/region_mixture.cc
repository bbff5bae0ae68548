#include "stylize/image/region_mixture.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/base/error.h"
#include "kernels/base/random.h"

namespace regrade {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Vector = Eigen::VectorXd;

constexpr int kMostIterations = 60;
constexpr double kLeastGain = 1e-4;  // nats a row

Eigen::Map<const Matrix> CovarianceOf(const RegionPart& part) {
  const auto n = static_cast<Eigen::Index>(part.mean.size());
  return {part.covariance.data(), n, n};
}

Vector RowOf(const FeatureRows& rows, int64_t i) {
  return Eigen::Map<const Eigen::VectorXf>(&rows.values[static_cast<size_t>(i) * rows.dimensions],
                                           rows.dimensions)
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

// Of the rows weighted by column k of `shares` [rows, parts]; parts without rows are left out.
RegionMixture Maximised(const FeatureRows& rows, const Matrix& shares) {
  constexpr double kEmpty = 1e-6;  // of all rows
  const double all = static_cast<double>(rows.rows());
  RegionMixture mixture;
  for (Eigen::Index k = 0; k < shares.cols(); ++k) {
    const double count = shares.col(k).sum();
    if (count <= kEmpty * all) continue;
    Vector mean = Vector::Zero(rows.dimensions);
    for (int64_t i = 0; i < rows.rows(); ++i) mean += shares(i, k) * RowOf(rows, i);
    mean /= count;
    Matrix covariance = Matrix::Zero(rows.dimensions, rows.dimensions);
    for (int64_t i = 0; i < rows.rows(); ++i) {
      const Vector d = RowOf(rows, i) - mean;
      covariance.noalias() += shares(i, k) * d * d.transpose();
    }
    mixture.push_back(PartOf(count / all, mean, covariance / count));
  }
  double kept = 0;
  for (const RegionPart& part : mixture) kept += part.weight;
  for (RegionPart& part : mixture) part.weight /= kept;
  return mixture;
}

// r_ik; returns the mean log density of a row, without the constant of all Gaussians.
double Expect(const RegionMixture& mixture, const FeatureRows& rows, Matrix* shares) {
  const auto parts = static_cast<Eigen::Index>(mixture.size());
  std::vector<Matrix> whitening;
  std::vector<double> scale;
  for (const RegionPart& part : mixture) {
    const Eigen::LLT<Matrix> cholesky(CovarianceOf(part));
    REGRADE_CHECK(cholesky.info() == Eigen::Success);
    const Matrix lower = cholesky.matrixL();
    whitening.push_back(lower.triangularView<Eigen::Lower>().solve(
        Matrix::Identity(rows.dimensions, rows.dimensions)));
    scale.push_back(std::log(part.weight) - lower.diagonal().array().log().sum());
  }
  shares->resize(rows.rows(), parts);
  Vector likelihood(rows.rows());
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < rows.rows(); ++i) {
    const Vector x = RowOf(rows, i);
    for (Eigen::Index k = 0; k < parts; ++k) {
      const size_t n = static_cast<size_t>(k);
      const Vector d =
          x - Eigen::Map<const Vector>(mixture[n].mean.data(), rows.dimensions);
      (*shares)(i, k) = scale[n] - 0.5 * (whitening[n] * d).squaredNorm();
    }
    // The largest share is exp(0) before it is divided: the sum is at least 1.
    const double largest = shares->row(i).maxCoeff();
    shares->row(i) = (shares->row(i).array() - largest).max(-700.0).exp();
    const double sum = shares->row(i).sum();
    shares->row(i) /= sum;
    likelihood[i] = largest + std::log(sum);
  }
  return likelihood.mean();
}

// Rows far from each other: each is drawn with the squared distance to those before it.
std::vector<int64_t> Centres(const FeatureRows& rows, int parts, uint64_t seed) {
  constexpr uint64_t kStream = 0x7265;
  std::vector<int64_t> centres = {static_cast<int64_t>(
      RandomIndex(seed, kStream, 0, static_cast<uint64_t>(rows.rows())))};
  std::vector<double> squared(static_cast<size_t>(rows.rows()),
                              std::numeric_limits<double>::infinity());
  while (std::ssize(centres) < parts) {
    const Vector last = RowOf(rows, centres.back());
    double sum = 0, farthest = 0;
    for (size_t i = 0; i < squared.size(); ++i) {
      squared[i] = std::min(squared[i],
                            (RowOf(rows, static_cast<int64_t>(i)) - last).squaredNorm());
      sum += squared[i];
      farthest = std::max(farthest, squared[i]);
    }
    if (farthest <= kPartFloor) break;
    double place = sum * RandomDouble(seed, kStream, centres.size());
    size_t drawn = 0;
    while (drawn + 1 < squared.size() && (place -= squared[drawn]) >= 0) ++drawn;
    centres.push_back(static_cast<int64_t>(drawn));
  }
  return centres;
}

}  // namespace

RegionMixture FitRegions(const FeatureRows& rows, int parts, uint64_t seed) {
  REGRADE_CHECK(rows.rows() > 0 && parts >= 1);
  const std::vector<int64_t> centres = Centres(rows, parts, seed);
  Matrix shares = Matrix::Zero(rows.rows(), std::ssize(centres));
  for (int64_t i = 0; i < rows.rows(); ++i) {
    Eigen::Index nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (size_t k = 0; k < centres.size(); ++k) {
      const double d = (RowOf(rows, i) - RowOf(rows, centres[k])).squaredNorm();
      if (d < least) least = d, nearest = static_cast<Eigen::Index>(k);
    }
    shares(i, nearest) = 1;
  }
  RegionMixture mixture = Maximised(rows, shares);
  double likelihood = Expect(mixture, rows, &shares);
  for (int i = 0; i < kMostIterations; ++i) {
    RegionMixture next = Maximised(rows, shares);
    const double then = Expect(next, rows, &shares);
    mixture = std::move(next);
    if (!(then - likelihood >= kLeastGain)) break;
    likelihood = then;
  }
  return mixture;
}

std::vector<float> RegionShares(const RegionMixture& mixture, const FeatureRows& rows) {
  Matrix shares;
  Expect(mixture, rows, &shares);
  std::vector<float> values(static_cast<size_t>(shares.size()));
  std::copy(shares.data(), shares.data() + shares.size(), values.begin());
  return values;
}

double PartDistance(const RegionPart& a, const RegionPart& b) {
  REGRADE_CHECK_EQ(a.mean.size(), b.mean.size());
  const auto n = static_cast<Eigen::Index>(a.mean.size());
  const Vector d = Eigen::Map<const Vector>(a.mean.data(), n) -
                   Eigen::Map<const Vector>(b.mean.data(), n);
  const Matrix root = Raised(CovarianceOf(a), 0, 0.5);
  const Matrix between = root * CovarianceOf(b) * root;
  const double shared = Raised((between + between.transpose()) / 2, 0, 0.5).trace();
  // Rounding may leave a little less than nothing between equal parts.
  return d.squaredNorm() +
         std::max(0.0, CovarianceOf(a).trace() + CovarianceOf(b).trace() - 2 * shared);
}

}  // namespace regrade
