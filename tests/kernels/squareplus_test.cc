// squareplus and its derivative, in double and float (hard cases H31 to H33).
#include <gtest/gtest.h>

#include <cmath>

#include "kernels/network/lipschitz_layer.h"
#include "tests/support/derivative.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

using testing::Derivative;

long double ExactSquareplus(long double x, long double b) {
  const long double r = sqrtl(x * x + b);
  return x >= 0 ? (x + r) / 2 : b / (2 * (r - x));
}

TEST(Squareplus, H31_AgreesWithLongDouble) {
  for (int e = -30; e <= 30; ++e)
    for (const double m : {1.0, 1.7, 3.3, 9.1})
      for (const double sign : {-1.0, 1.0}) {
        const double x = sign * m * std::pow(10.0, e);
        const long double exact = ExactSquareplus(x, kSquareplusB);
        // Three roundings (root, sum, quotient), each half an ulp, and hypot's own ulp.
        const double off = static_cast<double>(Squareplus(x) / exact - 1);
        EXPECT_NEAR(
            off, 0,
            testing::RecordDigits("squareplus", testing::Computed::kDouble, off, 4.5e-16))
            << x;
      }
  EXPECT_DOUBLE_EQ(Squareplus(0.0), 0.5e-6);
  // In float as well, where a square overflows from 1.9e19: four roundings of 6e-8, and one to
  // a subnormal number.
  for (const float x : {-1e30f, -1e19f, -1.0f, -1e-4f, 1e-4f, 1.0f, 1e19f, 1e30f}) {
    const long double exact = ExactSquareplus(x, static_cast<float>(kSquareplusB));
    EXPECT_NEAR(Squareplus(x), static_cast<double>(exact),
                testing::RecordDigits("squareplus in float", testing::Computed::kFloat,
                                      Squareplus(x) - static_cast<double>(exact), 2.5e-7,
                                      static_cast<double>(exact) + 4e-39))
        << x;
  }
}

TEST(Squareplus, H32_DerivativeWithoutCancellation) {
  for (const double x : {-3.0, -0.2, -1e-3, -1e-6, 0.0, 1e-6, 0.4, 5.0}) {
    // b = 1e-2 so that finite differences resolve the bend; the formula is the same.
    const double numeric = Derivative([](double y) { return Squareplus(y, 1e-2); }, x, 1e-3);
    EXPECT_NEAR(
        SquareplusDerivative(x, 1e-2), numeric,
        testing::RecordDigits("derivative against differences", testing::Computed::kDouble,
                              SquareplusDerivative(x, 1e-2) - numeric, 1e-9))
        << x;
    // For the actual b digits are counted: the roundings of squareplus, the root and a
    // quotient.
    const long double b = kSquareplusB;
    const long double exact =
        ExactSquareplus(x, b) / sqrtl(static_cast<long double>(x) * x + b);
    const double off = static_cast<double>(SquareplusDerivative(x) / exact - 1);
    EXPECT_NEAR(off, 0,
                testing::RecordDigits("derivative", testing::Computed::kDouble, off, 1e-15))
        << x;
  }
  EXPECT_EQ(SquareplusDerivative(0.0, 0.0), 0.5);
}

TEST(Squareplus, H33_FloatIsPositiveWhereTheTextbookFormIsZero) {
  const float x = -0.01f, b = static_cast<float>(kSquareplusB);
  EXPECT_EQ(0.5f * (x + std::sqrt(x * x + b)), 0.0f);
  EXPECT_NEAR(Squareplus(x), 2.5e-11f,
              testing::RecordDigits("squareplus of -0.01", testing::Computed::kFloat,
                                    Squareplus(x) - 2.5e-11, 4e-6, 2.5e-11));
  EXPECT_GT(SquareplusDerivative(x), 0.0f);
}

}  // namespace
}  // namespace regrade
