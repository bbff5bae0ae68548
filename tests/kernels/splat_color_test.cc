// Spherical harmonics of degree 3, and the colours of splats.
#include "kernels/splats/splat_color.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "kernels/base/random.h"
#include "kernels/splats/covariance.h"
#include "kernels/splats/rotate_harmonics.h"
#include "tests/support/derivative.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

Vec3d RandomDirection(uint64_t i) {
  const auto draw = [&](uint64_t a) { return 2 * RandomDouble(71, i, a) - 1; };
  return Normalized(Vec3d{draw(0), draw(1), draw(2)});
}

// Roots and weights of Gauss and Legendre, exact to degree 2 n - 1 on [-1, 1].
void GaussLegendre(int n, std::vector<double>* z, std::vector<double>* weight) {
  for (int i = 0; i < n; ++i) {
    double x = std::cos(M_PI * (i + 0.75) / (n + 0.5)), slope = 0;
    for (int step = 0; step < 50; ++step) {
      double before = 1, p = x;
      for (int k = 2; k <= n; ++k) {
        const double next = ((2 * k - 1) * x * p - (k - 1) * before) / k;
        before = p, p = next;
      }
      slope = n * (x * p - before) / (x * x - 1);
      x -= p / slope;
    }
    z->push_back(x);
    weight->push_back(2 / ((1 - x * x) * slope * slope));
  }
}

// A product of two functions has degree 6 in z and in the angle around it: the sum is exact.
TEST(SphericalHarmonics, SixteenFunctionsAreOrthonormal) {
  std::vector<double> z, weight;
  GaussLegendre(8, &z, &weight);
  constexpr int kAround = 16;
  double gram[16][16] = {};
  for (size_t i = 0; i < z.size(); ++i)
    for (int j = 0; j < kAround; ++j) {
      const double angle = 2 * M_PI * (j + 0.3) / kAround, r = std::sqrt(1 - z[i] * z[i]);
      double gamma[16];
      ShBasis(16, Vec3d{r * std::cos(angle), r * std::sin(angle), z[i]}, gamma);
      for (int a = 0; a < 16; ++a)
        for (int b = 0; b < 16; ++b)
          gram[a][b] += gamma[a] * gamma[b] * weight[i] * 2 * M_PI / kAround;
    }
  for (int a = 0; a < 16; ++a)
    for (int b = 0; b < 16; ++b) {
      const double off = gram[a][b] - (a == b);
      EXPECT_NEAR(
          off, 0,
          testing::RecordDigits("inner products", testing::Computed::kDouble, off, 1e-14))
          << a << " " << b;
    }
}

// |Gamma(d)| = (L + 1) / (2 sqrt(pi)) in every direction: 1.128 at degree 3.
TEST(SphericalHarmonics, TheNormOfTheBasisIsConstant) {
  for (int degree = 0; degree <= 3; ++degree) {
    const int basis = BasisOfDegree(degree);
    const double exact = (degree + 1) / (2 * std::sqrt(M_PI));
    for (uint64_t i = 0; i < 2000; ++i) {
      double gamma[16], square = 0;
      ShBasis(basis, RandomDirection(i), gamma);
      for (int k = 0; k < basis; ++k) square += gamma[k] * gamma[k];
      ASSERT_NEAR(std::sqrt(square), exact,
                  testing::RecordDigits("norm of the basis", testing::Computed::kDouble,
                                        std::sqrt(square) - exact, 2e-15, exact));
    }
  }
  EXPECT_NEAR(4 / (2 * std::sqrt(M_PI)), 1.128, 5e-4);
}

// By the coefficients and by the mean, through the direction's normalisation.
TEST(SplatColor, AdjointEqualsDerivativeInDouble) {
  const Vec3d center{0.3, -0.2, 0.7}, d_color{0.7, -0.4, 0.9};
  for (const int basis : {1, 4, 9, 16})
    for (uint64_t i = 0; i < 20; ++i) {
      std::vector<double> sh(static_cast<size_t>(3 * basis)), d_sh(sh.size());
      for (size_t k = 0; k < sh.size(); ++k) sh[k] = RandomDouble(72, i, k) - 0.4;
      Vec3d mean = center + RandomDirection(i) * (0.5 + RandomDouble(73, i, 0)), d_mean{};
      const auto color = [&] {
        return SplatColor(basis, sh.data(), DirectionToMean(center, mean).unit);
      };
      SplatColorAdjoint(basis, sh.data(), DirectionToMean(center, mean), color(), d_color,
                        d_sh.data(), &d_mean);
      const auto check = [&](double* x, double by_adjoint) {
        const double numeric = testing::DerivativeBy(
            x, [&] { return Dot(color(), d_color); }, 1e-3, testing::kKink * 100);
        if (std::isnan(numeric)) return;  // a channel turns black
        EXPECT_NEAR(
            numeric, by_adjoint,
            testing::RecordDigits("gradient of a colour", testing::Computed::kDouble,
                                  numeric - by_adjoint, 1e-8, 1 + std::abs(by_adjoint)));
      };
      for (size_t k = 0; k < sh.size(); ++k) check(&sh[k], d_sh[k]);
      for (int a = 0; a < 3; ++a) check(&mean[a], d_mean[a]);
    }
}

// Seen from 1e5 away, in float: the direction is found in double.
TEST(SplatColor, FarCamerasKeepTheDigitsOfDirections) {
  const Vec3d center{1e5, 2e5, -1e5};
  for (uint64_t i = 0; i < 100; ++i) {
    const Vec3f mean = (center + RandomDirection(i) * 0.5).Cast<float>();
    const Vec3d exact = Normalized(mean.Cast<double>() - center);
    const Vec3f got = DirectionToMean(center, mean).unit;
    for (int a = 0; a < 3; ++a)
      ASSERT_NEAR(got[a], exact[a],
                  testing::RecordDigits("direction", testing::Computed::kFloat,
                                        got[a] - exact[a], 6e-8));
  }
}

TEST(RotateHarmonics, ATurnedFunctionIsTheFunctionOfTurnedDirections) {
  const double quaternion[4] = {0.3, -0.7, 0.5, 0.2};
  const Mat3d turn = RotationOf(quaternion);
  const HarmonicsMatrix matrix = RotateHarmonics(turn);
  for (uint64_t i = 0; i < 20; ++i) {
    const Vec3d direction = RandomDirection(i);
    double turned[16], own[16];
    ShBasis(16, turn * direction, turned);
    ShBasis(16, direction, own);
    // Row by row: Gamma_j(R^T d) = sum_i M_ij Gamma_i(d), at d = R direction.
    for (size_t j = 0; j < 16; ++j) {
      double sum = 0;
      for (size_t k = 0; k < 16; ++k) sum += matrix[k][j] * turned[k];
      EXPECT_NEAR(sum, own[j], 1e-13) << j;
    }
  }
}

TEST(RotateHarmonics, HalfTurnsOnlyChangeSigns) {
  for (int axis = -1; axis < 3; ++axis) {  // -1: the identity
    Mat3d turn;
    for (int a = 0; a < 3; ++a) turn(a, a) = axis < 0 || a == axis ? 1 : -1;
    const HarmonicsMatrix matrix = RotateHarmonics(turn);
    const Vec3d direction = RandomDirection(3);
    double turned[16], own[16];
    ShBasis(16, turn * direction, turned);
    ShBasis(16, direction, own);
    for (size_t i = 0; i < 16; ++i)
      for (size_t j = 0; j < 16; ++j)
        EXPECT_EQ(matrix[i][j], i != j                   ? 0
                                : turned[i] * own[i] > 0 ? 1
                                                         : -1)
            << axis << " " << i << " " << j;
  }
}

}  // namespace
}  // namespace regrade
