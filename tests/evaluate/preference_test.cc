#include "evaluate/preference.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "kernels/base/random.h"

namespace regrade {
namespace {

// Published values of the exact interval (Clopper and Pearson), and the rule of three: none of
// n has the upper end 1 - 0.025^(1/n).
TEST(Preference, BinomialIntervalsAreExact) {
  const Interval half = BinomialInterval(5, 10);
  EXPECT_NEAR(half.low, 0.1871, 1e-4);
  EXPECT_NEAR(half.high, 0.8129, 1e-4);
  const Interval most = BinomialInterval(79, 100);
  EXPECT_NEAR(most.low, 0.6971, 1e-4);
  EXPECT_NEAR(most.high, 0.8651, 1e-4);
  const Interval none = BinomialInterval(0, 20);
  EXPECT_EQ(none.low, 0);
  EXPECT_NEAR(none.high, 1 - std::pow(0.025, 1 / 20.0), 1e-9);
  EXPECT_EQ(BinomialInterval(7, 7).high, 1);
}

TEST(Preference, SignTestOfKnownSplits) {
  EXPECT_EQ(SignTest(4, 8), 1);
  EXPECT_NEAR(SignTest(0, 5), 2.0 / 32, 1e-12);
  EXPECT_NEAR(SignTest(9, 10), 22.0 / 1024, 1e-12);
  EXPECT_NEAR(SignTest(1, 10), 22.0 / 1024, 1e-12);
}

// Of two methods the strengths are the shares; of all methods shown at once, too.
TEST(Preference, StrengthsAreSharesWhereEverythingIsShown) {
  std::vector<Choice> two, three;
  for (int k = 0; k < 10; ++k) two.push_back({{0, 1}, k < 7 ? 0 : 1});
  for (int k = 0; k < 100; ++k) three.push_back({{0, 1, 2}, k < 79 ? 0 : k < 90 ? 1 : 2});
  EXPECT_NEAR(BradleyTerry(two, 2)[0], 0.7, 1e-9);
  const std::vector<double> strength = BradleyTerry(three, 3);
  EXPECT_NEAR(strength[0], 0.79, 1e-9);
  EXPECT_NEAR(strength[2], 0.10, 1e-9);
}

// 0 beats 1 three to one and 1 beats 2 three to one: by the model 0 beats 2 nine to one.
TEST(Preference, StrengthsReachMethodsThatNeverMet) {
  std::vector<Choice> choices;
  for (int k = 0; k < 4; ++k) {
    choices.push_back({{0, 1}, k < 3 ? 0 : 1});
    choices.push_back({{1, 2}, k < 3 ? 1 : 2});
  }
  const std::vector<double> strength = BradleyTerry(choices, 3);
  EXPECT_NEAR(strength[0] / strength[2], 9, 1e-6);
  EXPECT_NEAR(std::accumulate(strength.begin(), strength.end(), 0.0), 1, 1e-12);
}

TEST(Preference, AMethodThatIsNeverChosenHasNoStrength) {
  const std::vector<double> strength = BradleyTerry({{{0, 1}, 0}, {{0, 2}, 2}}, 3);
  EXPECT_EQ(strength[1], 0);
  EXPECT_EQ(BradleyTerry({}, 2), (std::vector<double>{0.5, 0.5}));
}

// In most of 60 simulated studies of 20 participants the interval has the true strength; the
// bootstrap of few participants is slightly narrow.
TEST(Preference, IntervalsCoverTheStrength) {
  const double truth = 0.65;
  int covered = 0;
  for (uint64_t study = 0; study < 60; ++study) {
    std::vector<std::vector<Choice>> participants(20);
    for (uint64_t p = 0; p < 20; ++p)
      for (uint64_t k = 0; k < 8; ++k)
        participants[p].push_back({{0, 1}, RandomDouble(study, p, k) < truth ? 0 : 1});
    const Interval interval = BradleyTerryIntervals(participants, 2)[0];
    covered += interval.low <= truth && truth <= interval.high;
  }
  EXPECT_GE(covered, 50);  // of 57 expected
  EXPECT_LE(covered, 60);
  EXPECT_TRUE(BradleyTerryIntervals({{{{0, 1}, 0}}}, 2).empty());
}

}  // namespace
}  // namespace regrade
