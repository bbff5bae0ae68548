#include "evaluate/bootstrap.h"

#include <gtest/gtest.h>

#include <cmath>

#include "kernels/base/random.h"

namespace regrade {
namespace {

// Sums of `together` consecutive uniform numbers: mean together / 2; neighbours are correlated.
std::vector<double> Film(int length, int together, uint64_t seed) {
  std::vector<double> values;
  for (int i = 0; i < length; ++i) {
    double sum = 0;
    for (int k = 0; k < together; ++k)
      sum += RandomDouble(seed, 99, static_cast<uint64_t>(i + k));
    values.push_back(sum);
  }
  return values;
}

// The number of 200 films whose interval covers the true mean.
int Covered(int length, int together, int block) {
  int covered = 0;
  for (uint64_t seed = 0; seed < 200; ++seed) {
    const auto interval = BootstrapMean(Film(length, together, seed), block, seed);
    covered += interval->low <= together / 2.0 && together / 2.0 <= interval->high;
  }
  return covered;
}

TEST(Bootstrap, CoversTheMeanInNineteenOfTwenty) {
  // 190 of 200 expected; four standard deviations (3.1 each) below, and slightly fewer because
  // of only 60 values.
  EXPECT_GE(Covered(60, 1, 1), 177);
}

TEST(Bootstrap, RunsKeepOverlappingPairsTogether) {
  const int in_runs = Covered(60, 5, 5), one_by_one = Covered(60, 5, 1);
  // 167 and 124 expected, from 400 films in numpy; standard deviations 5 and 7. Runs of 5 break
  // half of the correlations of length 5, so they are also below 190.
  EXPECT_GE(in_runs, 152);
  EXPECT_LE(one_by_one, 145);
}

TEST(Bootstrap, WidthIsThatOfTheMean) {
  // The mean of 400 uniform numbers has standard deviation 0.2887 / 20: 1.96 of them each way.
  const auto interval = BootstrapMean(Film(400, 1, 3), 1);
  EXPECT_NEAR((interval->high - interval->low) / 2, 1.96 * 0.2887 / 20,
              0.15 * 1.96 * 0.2887 / 20);
}

TEST(Bootstrap, EqualValuesHaveNoWidthAndFewNoInterval) {
  const auto interval = BootstrapMean(std::vector<double>(12, 31.5), 5);
  ASSERT_TRUE(interval);
  EXPECT_NEAR(interval->low, 31.5, 1e-12);
  EXPECT_NEAR(interval->high, 31.5, 1e-12);
  EXPECT_FALSE(BootstrapMean({}, 1));
  EXPECT_FALSE(BootstrapMean({30}, 1));
  EXPECT_FALSE(BootstrapMean(std::vector<double>(9, 30), 5));  // less than two runs
}

TEST(Bootstrap, SameSeedSameInterval) {
  const std::vector<double> film = Film(50, 5, 1);
  const auto a = BootstrapMean(film, 5, 7), b = BootstrapMean(film, 5, 7),
             c = BootstrapMean(film, 5, 8);
  EXPECT_EQ(a->low, b->low);
  EXPECT_EQ(a->high, b->high);
  EXPECT_NE(a->low, c->low);
}

}  // namespace
}  // namespace regrade
