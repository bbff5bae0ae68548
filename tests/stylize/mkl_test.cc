#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <string>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "stylize/image/monge_kantorovich.h"
#include "tests/support/floating_point_traps.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kEps = std::numeric_limits<double>::epsilon();

Mat3d FromEigen(const Matrix3d& m) {
  Mat3d result;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) result(i, j) = m(i, j);
  return result;
}

Matrix3d ToEigen(const Mat3d& m) {
  Matrix3d result;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) result(i, j) = m(i, j);
  return result;
}

Matrix3d RandomRotation(uint64_t seed) {
  Matrix3d m;
  for (int i = 0; i < 9; ++i) m(i) = RandomDouble(seed, 9, i) - 0.5;
  return m.householderQr().householderQ();
}

Matrix3d Rotated(uint64_t seed, double a, double b, double c) {
  const Matrix3d r = RandomRotation(seed);
  const Matrix3d m = r * Vector3d(a, b, c).asDiagonal() * r.transpose();
  return 0.5 * (m + m.transpose());
}

ColorStatistics Statistics(const Matrix3d& covariance, const Vec3d& mean = {0.4, 0.5, 0.6}) {
  return {mean, FromEigen(covariance), 1000};
}

MklMap Mkl(const Matrix3d& a, const Matrix3d& b) {
  return ComputeMkl(Statistics(a), Statistics(b, {0.7, 0.3, 0.2}));
}

// f of the eigenvalues; those at rounding are left at 0.
template <typename F>
Matrix3d Spectral(const Matrix3d& m, const F& f) {
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(0.5 * (m + m.transpose()));
  Vector3d values;
  for (int i = 0; i < 3; ++i) {
    const double v = solver.eigenvalues()(i);
    values(i) = v > 1e-13 * solver.eigenvalues()(2) ? f(v) : 0;
  }
  return solver.eigenvectors() * values.asDiagonal() * solver.eigenvectors().transpose();
}

double Root(double v) { return std::sqrt(v); }
double InverseRoot(double v) { return 1 / std::sqrt(v); }

// The paper's form; with a singular A, the pseudo-inverse of its root.
Matrix3d Primal(const Matrix3d& a, const Matrix3d& b) {
  const Matrix3d root = Spectral(a, Root), inverse = Spectral(a, InverseRoot);
  return inverse * Spectral(root * b * root, Root) * inverse;
}

Matrix3d Ridge(const Matrix3d& a, const Matrix3d& b, double epsilon) {
  return Primal(a + epsilon * Matrix3d::Identity(), b);
}

double Norm2(const Matrix3d& m) { return m.jacobiSvd().singularValues()(0); }

const Matrix3d kStyle = Rotated(3, 0.05, 0.012, 0.003);  // a colourful picture

TEST(Mkl, H1_MovesTheCovarianceExactly) {
  for (uint64_t seed = 0; seed < 200; ++seed) {
    for (const double condition : {1.0, 1e1, 1e3, 1e6}) {
      // Smallest variance well above what the rank rule calls colour.
      const double smallest = 2e-4;
      const Matrix3d a =
          Rotated(seed, smallest, smallest * std::sqrt(condition), smallest * condition);
      const Matrix3d b = Rotated(seed + 1000, 0.05, 0.01, 1e-3);
      const MklMap mkl = Mkl(a, b);
      const Matrix3d t = ToEigen(mkl.map.matrix);
      const double residual = (t * a * t - b).norm() / b.norm();
      ASSERT_LE(residual, testing::RecordDigits(
                              "residual at condition " + std::to_string(std::lround(condition)),
                              testing::Computed::kDouble, residual, 50 * condition * kEps))
          << condition;
      ASSERT_LE((t - t.transpose()).norm(), 1e-14 * mkl.norm);
      ASSERT_GT(Eigen::SelfAdjointEigenSolver<Matrix3d>(t).eigenvalues()(0), 0);
      ASSERT_EQ(mkl.rank, 3);
      ASSERT_TRUE(mkl.notices.empty());
      ASSERT_LE((t - Primal(a, b)).norm() / t.norm(), 1e3 * condition * kEps);
    }
  }
}

TEST(Mkl, H1_ExactForAnyStyleIfThePhotoIsRegular) {
  // The rank rule looks at the photo's variances alone: a style that is nearly a line of
  // colours is still met to the last digits.
  const Matrix3d a = Rotated(5, 0.01, 0.01, 0.02), b = Rotated(6, 0.05, 1e-5, 1e-7);
  const Matrix3d t = ToEigen(Mkl(a, b).map.matrix);
  EXPECT_LE((t * a * t - b).norm(),
            testing::RecordDigits("a style nearly a line", testing::Computed::kDouble,
                                  (t * a * t - b).norm(), 1e-14, b.norm()));
}

TEST(Mkl, H2_SameStatisticsGiveTheIdentity) {
  for (uint64_t seed = 0; seed < 100; ++seed) {
    const Matrix3d a = Rotated(seed, 2e-4, 3e-3, 0.06);
    const MklMap mkl = ComputeMkl(Statistics(a), Statistics(a));
    const double off = (ToEigen(mkl.map.matrix) - Matrix3d::Identity()).norm();
    ASSERT_LE(off,
              testing::RecordDigits("the identity", testing::Computed::kDouble, off, 1e-13));
    ASSERT_LE(Norm(mkl.map.offset), 1e-13);
    ASSERT_NEAR(mkl.norm, 1, 1e-13);
  }
}

TEST(Mkl, H3_GreyPhotoColouredStyle) {
  const Vector3d u = Vector3d::Ones().normalized();
  const double variance = 0.04;
  const Matrix3d a = variance * u * u.transpose();
  const MklMap mkl = Mkl(a, kStyle);
  const Vector3d tu = ToEigen(mkl.map.matrix) * u;
  const Vector3d limit = kStyle * u / std::sqrt(variance * u.dot(kStyle * u));
  EXPECT_LE((tu - limit).norm(),
            testing::RecordDigits("the limit on grey", testing::Computed::kDouble,
                                  (tu - limit).norm(), 1e-13));
  EXPECT_EQ(mkl.rank, 1);
  ASSERT_EQ(mkl.notices.size(), 1u);
  EXPECT_NE(mkl.notices[0].find("line"), std::string::npos);
  // The limit of the ridge solution: its error falls as the root of the ridge.
  double last = 0;
  for (const double epsilon : {1e-6, 1e-8, 1e-10}) {
    const double error = (Ridge(a, kStyle, epsilon) * u - tu).norm();
    if (last > 0) {
      EXPECT_NEAR(error / last, 0.1, 0.03) << epsilon;
    }
    last = error;
  }
  EXPECT_LE(last, 1e-4);
}

TEST(Mkl, H4_ThePrimalPseudoInverseWouldLoseTheTint) {
  const Vector3d u = Vector3d::Ones().normalized();
  const Matrix3d a = 0.04 * u * u.transpose();
  const Matrix3d t = ToEigen(Mkl(a, kStyle).map.matrix), p = Primal(a, kStyle);
  EXPECT_LE((p * u).cross(u).norm(),
            testing::RecordBound("tint that the primal form leaves", testing::Computed::kDouble,
                                 (p * u).cross(u).norm(), 1e-12));  // grey stays grey
  EXPECT_GE((t * u).cross(u).norm(), 0.1);
  EXPECT_GE((t * a * t).trace(), 1.05 * (p * a * p).trace());
}

TEST(Mkl, H5_ColoursInAPlane) {
  const Matrix3d a = Rotated(11, 0, 0.01, 0.05);
  const MklMap mkl = Mkl(a, kStyle);
  const Matrix3d t = ToEigen(mkl.map.matrix), ridge = Ridge(a, kStyle, 1e-10);
  const Matrix3d plane = Spectral(a, [](double) { return 1.0; });
  EXPECT_LE(
      ((t - ridge) * plane).norm(),
      testing::RecordBound("from a ridge of 1e-10 on the plane", testing::Computed::kDouble,
                           ((t - ridge) * plane).norm(), 1e-3));
  EXPECT_LE(mkl.norm, testing::RecordBound("norm for colours in a plane",
                                           testing::Computed::kDouble, mkl.norm, 5));
  EXPECT_GE(Norm2(ridge), 1000);
  EXPECT_EQ(mkl.rank, 2);
}

TEST(Mkl, H6_PhotoOfOneColour) {
  const MklMap mkl = Mkl(Matrix3d::Zero(), kStyle);
  EXPECT_EQ(mkl.map({0.1, 0.9, 0.3}), (Vec3d{0.7, 0.3, 0.2}));
  EXPECT_EQ(mkl.norm, 0);
  EXPECT_EQ(mkl.rank, 0);
  ASSERT_EQ(mkl.notices.size(), 1u);
  EXPECT_NE(mkl.notices[0].find("the photo has a single colour"), std::string::npos);
}

TEST(Mkl, H7_H20_StyleOfOneColour) {
  const MklMap mkl = Mkl(Rotated(1, 0.01, 0.02, 0.03), Matrix3d::Zero());
  EXPECT_EQ(mkl.map({0.1, 0.9, 0.3}), (Vec3d{0.7, 0.3, 0.2}));
  EXPECT_EQ(mkl.norm, 0);  // exactly: K_est^(1/6) is then 0 as well
  ASSERT_EQ(mkl.notices.size(), 1u);
  EXPECT_NE(mkl.notices[0].find("the style image has a single colour"), std::string::npos);
}

TEST(Mkl, H8_OrthogonalSupports) {
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const Matrix3d r = RandomRotation(seed);
    const MklMap mkl =
        Mkl(0.04 * r.col(0) * r.col(0).transpose(), 0.02 * r.col(1) * r.col(1).transpose());
    for (int i = 0; i < 3; ++i) ASSERT_EQ(mkl.map.matrix.row[i], Vec3d{}) << seed;
    ASSERT_EQ(mkl.norm, 0);
  }
}

TEST(Mkl, H9_ContinuousThroughTheNoiseFloor) {
  for (uint64_t seed = 0; seed < 40; ++seed) {
    MklMap last;
    for (double smallest = 1e-9; smallest < 1e-3; smallest *= 1.2) {
      const MklMap mkl = Mkl(Rotated(seed, smallest, 0.01, 0.06), kStyle);
      if (last.norm > 0) {
        ASSERT_LE(mkl.norm / last.norm,
                  testing::RecordBound("growth of the norm in a step of 1.2",
                                       testing::Computed::kDouble, mkl.norm / last.norm, 2))
            << smallest;
        ASSERT_LE(last.norm / mkl.norm, 1.25) << smallest;
        const double step = Norm2(ToEigen(mkl.map.matrix) - ToEigen(last.map.matrix));
        ASSERT_LE(step, last.norm) << smallest;
      }
      ASSERT_LE(mkl.norm, 70);  // a step of 8 bits is never spread over the whole style
      last = mkl;
    }
  }
}

TEST(Mkl, H9_ContinuousWhereEigenvaluesOfTheInnerRootCross) {
  // B^1/2 A B^1/2 has a double eigenvalue at smallest = 1e-5: its eigenvectors turn by 90
  // degrees between one step and the next. A rule that weights them one by one would jump.
  Matrix3d tilt;
  tilt = Eigen::AngleAxisd(1e-6, Vector3d::UnitZ());
  const Matrix3d b = Vector3d(1e-2, 1e-5, 1e-2).asDiagonal();
  MklMap last;
  for (double smallest = 0.9e-5; smallest < 1.1e-5; smallest *= 1.001) {
    const Matrix3d d = Vector3d(smallest, 1e-2, 2e-2).asDiagonal();
    const Matrix3d a = tilt * d * tilt.transpose();
    const MklMap mkl = Mkl(0.5 * (a + a.transpose()), b);
    if (last.norm > 0) {
      ASSERT_LE(Norm2(ToEigen(mkl.map.matrix) - ToEigen(last.map.matrix)), 0.003 * last.norm)
          << smallest;
    }
    last = mkl;
  }
}

TEST(Mkl, H9_RankWeightIsSmooth) {
  EXPECT_EQ(RankWeight(0), 0);
  EXPECT_EQ(RankWeight(1), 0);
  EXPECT_EQ(RankWeight(100), 1);
  EXPECT_EQ(RankWeight(1e30), 1);
  EXPECT_NEAR(RankWeight(10), 0.25, 1e-15);
  for (double x = 0.5; x < 200; x *= 1.01) {
    EXPECT_GE(RankWeight(1.01 * x), RankWeight(x));
    EXPECT_LE(RankWeight(1.01 * x) - RankWeight(x), 0.005);
  }
}

TEST(Mkl, H10_GreyPhotoHasASmallNorm) {
  const Vector3d u = Vector3d::Ones().normalized();
  const Matrix3d grey = 0.04 * u * u.transpose();
  const Matrix3d noisy = grey + 0.9 * kRoundingVariance * Matrix3d::Identity();
  const double exact = Mkl(grey, kStyle).norm;
  EXPECT_LE(exact, 3);
  // The variance along grey itself grows by the noise, 3e-5 of it.
  const double of_noisy = Mkl(noisy, kStyle).norm;
  EXPECT_LE(std::abs(of_noisy / exact - 1),
            testing::RecordBound("change of the norm by the noise of 8 bits",
                                 testing::Computed::kDouble, of_noisy / exact - 1, 1e-4));
  EXPECT_GE(Norm2(Ridge(grey, kStyle, kRoundingVariance)), 50);  // what a ridge would feed
}

TEST(Mkl, H11_RankIsAtMostColoursMinusOne) {
  const Vec3f colors[4] = {
      {0.9f, 0.1f, 0.2f}, {0.1f, 0.8f, 0.3f}, {0.2f, 0.3f, 0.7f}, {0.9f, 0.9f, 0.1f}};
  for (int n = 1; n <= 4; ++n) {
    Image image(n, 1);
    for (int i = 0; i < n; ++i)
      for (int c = 0; c < 3; ++c) image.at(i, 0)[c] = colors[i][c];
    const MklMap mkl = ComputeMkl(MeasureColor(image), Statistics(kStyle));
    EXPECT_EQ(mkl.rank, n - 1);
    EXPECT_LE(mkl.norm, 10);
  }
}

TEST(Mkl, H13_AsymmetryDoesNotMatter) {
  const Matrix3d a = Rotated(21, 5e-3, 0.01, 0.05);
  const Matrix3d t = ToEigen(Mkl(a, kStyle).map.matrix);
  for (uint64_t seed = 0; seed < 20; ++seed) {
    Matrix3d noise;
    for (int i = 0; i < 9; ++i) noise(i) = 2 * RandomDouble(seed, 4, i) - 1;
    // As rounding leaves it, divided by the smallest variance on its way into T.
    for (const MklMap& mkl : {Mkl(a + 1e-13 * noise, kStyle), Mkl(a, kStyle + 1e-13 * noise)}) {
      const Matrix3d other = ToEigen(mkl.map.matrix);
      EXPECT_LE(Norm2(other - t),
                testing::RecordBound("change by an asymmetry of 1e-13",
                                     testing::Computed::kDouble, Norm2(other - t), 1e-10));
      EXPECT_EQ((other - other.transpose()).norm(), 0);
    }
    // One triangle alone would let this through.
    const Matrix3d skew = 1e-6 * (noise - noise.transpose());
    EXPECT_LE(Norm2(ToEigen(Mkl(a + skew, kStyle).map.matrix) - t), 1e-13);
    EXPECT_LE(Norm2(ToEigen(Mkl(a, kStyle + skew).map.matrix) - t), 1e-13);
  }
}

TEST(Mkl, H14_H15_WhatIsNoCovarianceIsRefused) {
  const testing::MayBeNotFinite allowed;
  const Matrix3d good = Rotated(2, 0.01, 0.02, 0.03);
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    for (int i = 0; i < 9; ++i) {
      Matrix3d spoiled = good;
      spoiled(i) = bad;
      EXPECT_THROW(Mkl(spoiled, good), CheckFailure);
      EXPECT_THROW(Mkl(good, spoiled), CheckFailure);
    }
    EXPECT_THROW(ComputeMkl(Statistics(good, {bad, 0, 0}), Statistics(good)), CheckFailure);
  }
  EXPECT_THROW(Mkl(Rotated(2, -0.01, 0.02, 0.03), good), CheckFailure);
  EXPECT_EQ(Mkl(Rotated(2, -1e-18, 0.02, 0.03), good).rank, 2);
}

TEST(Mkl, H19_NormIsTheLargestSingularValue) {
  for (uint64_t seed = 0; seed < 100; ++seed) {
    const MklMap mkl = Mkl(Rotated(seed, 3e-4, 0.01, 0.05), Rotated(seed + 7, 1e-4, 0.02, 0.2));
    const double by_svd = Norm2(ToEigen(mkl.map.matrix));
    EXPECT_NEAR(mkl.norm, by_svd,
                testing::RecordDigits("norm against the SVD", testing::Computed::kDouble,
                                      mkl.norm - by_svd, 1e-12, mkl.norm));
    EXPECT_NEAR(mkl.norm, SpectralNorm(mkl.map.matrix), 1e-12 * mkl.norm);
  }
}

TEST(Mkl, H21_AHugeNormIsSaid) {
  // Not from pictures: their variances are at most 1/4.
  const MklMap mkl = Mkl(1e-3 * Matrix3d::Identity(), 1e11 * Matrix3d::Identity());
  EXPECT_NEAR(mkl.norm, 1e7, 1e-3);
  ASSERT_EQ(mkl.notices.size(), 1u);
  EXPECT_NE(mkl.notices[0].find("1e+07"), std::string::npos);
}

}  // namespace
}  // namespace regrade
