// Adam and the learning rate schedule (hard cases H99 to H102, H105, H106).
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "kernels/base/random.h"
#include "kernels/optimize/adam.h"
#include "kernels/optimize/schedule.h"
#include "tests/support/floating_point_traps.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

// Uniform in [-1, 1).
double Between(uint64_t stream, uint64_t counter) {
  return 2 * RandomDouble(20231104, stream, counter) - 1;
}

TEST(Adam, H99_ZeroGradientMovesNothing) {
  AdamState state;
  std::vector<float> x = {1.5f}, g = {0.0f};
  ASSERT_TRUE(AdamStep({}, 0.1, {g.data(), 1}, {x.data(), 1}, &state));
  EXPECT_EQ(x[0], 1.5f);
}

TEST(Adam, H100_TinyGradientTakesATinyStep) {
  AdamState state;
  std::vector<float> x = {0.0f}, g = {1e-25f};
  ASSERT_TRUE(AdamStep({}, 1.0, {g.data(), 1}, {x.data(), 1}, &state));
  EXPECT_NEAR(x[0], -1e-17,
              testing::RecordDigits("a tiny step", testing::Computed::kFloat, x[0] + 1e-17,
                                    1e-2, 1e-17));
}

TEST(Adam, H101_H106_HugeAndNonFiniteGradientsAreRejected) {
  const testing::MayBeNotFinite allowed;
  for (const float bad : {2e19f, std::numeric_limits<float>::infinity(), std::nanf("")}) {
    AdamState state;
    std::vector<float> x = {1.0f, 2.0f}, g = {0.5f, 0.5f};
    ASSERT_TRUE(AdamStep({}, 0.1, {g.data(), 2}, {x.data(), 2}, &state));
    const std::vector<float> kept = x, moment = state.second_moment;
    g[1] = bad;
    EXPECT_FALSE(AdamStep({}, 0.1, {g.data(), 2}, {x.data(), 2}, &state));
    EXPECT_EQ(x, kept);
    EXPECT_EQ(state.second_moment, moment);
    EXPECT_EQ(state.steps, 1);
    EXPECT_EQ(state.rejected, 1);
    g[1] = 0.5f;
    EXPECT_TRUE(AdamStep({}, 0.1, {g.data(), 2}, {x.data(), 2}, &state));
    EXPECT_LT(x[1], kept[1]);
  }
}

TEST(Adam, H102_BiasCorrection) {
  // 0.999 as a double is 0.999 (1 + d), |d| < 1.2e-16: its complement has a relative error of
  // 1.2e-13.
  EXPECT_NEAR(AdamBiasCorrection(0.999, 1) / 0.001, 1,
              testing::RecordDigits("first correction of 0.999", testing::Computed::kDouble,
                                    AdamBiasCorrection(0.999, 1) / 0.001 - 1, 2e-13));
  EXPECT_NEAR(AdamBiasCorrection(0.9, 3) / 0.271, 1,
              testing::RecordDigits("third correction of 0.9", testing::Computed::kDouble,
                                    AdamBiasCorrection(0.9, 3) / 0.271 - 1, 1e-14));
  EXPECT_EQ(AdamBiasCorrection(0.999, 2000000), 1.0);
  // The length of the first step is the rate, for any scale of the gradient.
  for (const float scale : {1e-3f, 1.0f, 1e6f}) {
    AdamState state;
    std::vector<float> x = {0.0f}, g = {scale};
    AdamStep({}, 0.01, {g.data(), 1}, {x.data(), 1}, &state);
    EXPECT_NEAR(x[0], -0.01f, 1e-6f);
  }
}

TEST(Adam, FollowsTheFormula) {
  AdamState state;
  std::vector<float> x = {1.0f};
  double value = 1, m = 0, v = 0;
  for (int t = 1; t <= 50; ++t) {
    std::vector<float> g = {static_cast<float>(2 * x[0] + Between(40, t))};
    const double gd = g[0];
    AdamStep({}, 0.02, {g.data(), 1}, {x.data(), 1}, &state);
    m = 0.9 * m + 0.1 * gd;
    v = 0.999 * v + 0.001 * gd * gd;
    value -=
        0.02 * (m / (1 - std::pow(0.9, t))) / (std::sqrt(v / (1 - std::pow(0.999, t))) + 1e-8);
    EXPECT_NEAR(
        x[0], value,
        testing::RecordBound("fifty steps", testing::Computed::kFloat, x[0] - value, 1e-5))
        << t;  // fifty float updates of at most 0.02
  }
}

TEST(CosineAnnealing, H105_Table) {
  EXPECT_EQ(CosineAnnealing(0, 300, 1e-2, 1e-4), 1e-2);
  EXPECT_EQ(CosineAnnealing(299, 300, 1e-2, 1e-4), 1e-4);
  EXPECT_EQ(CosineAnnealing(5000, 300, 1e-2, 1e-4), 1e-4);
  EXPECT_EQ(CosineAnnealing(0, 0, 1e-2, 1e-4), 1e-2);
  EXPECT_EQ(CosineAnnealing(0, 1, 1e-2, 1e-4), 1e-2);
  const double middle = CosineAnnealing(150, 301, 1e-2, 1e-4);
  EXPECT_NEAR(middle, 0.5 * (1e-2 + 1e-4),
              testing::RecordDigits("rate at the middle", testing::Computed::kDouble,
                                    middle - 0.5 * (1e-2 + 1e-4), 2e-13, 5e-3));
  for (int t = 1; t < 320; ++t)
    EXPECT_LE(CosineAnnealing(t, 300, 1e-2, 1e-4), CosineAnnealing(t - 1, 300, 1e-2, 1e-4));
}

}  // namespace
}  // namespace regrade
