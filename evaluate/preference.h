// Statistics of choices: shares with intervals, and the Bradley-Terry model.
#pragma once

#include <cstdint>
#include <vector>

#include "evaluate/bootstrap.h"

namespace regrade {

// EQ(binomial-interval), Clopper and Pearson 1934: the exact 95 % interval of a probability
// after `successes` of `trials`: low solves P(X >= successes) = 0.025 and high P(X <=
// successes) = 0.025, X binomial; low = 0 without successes, high = 1 without failures. Choices
// must be independent. Both counts >= 0, trials >= 1 and successes <= trials.
Interval BinomialInterval(int64_t successes, int64_t trials);

// The two-sided probability of a split at least as uneven among equals: P(|X - n/2| >= |k -
// n/2|), X binomial of n = `trials` and 1/2.
double SignTest(int64_t successes, int64_t trials);

// One choice among methods, by index.
struct Choice {
  std::vector<int> shown;  // at least two, different
  int chosen = 0;          // one of them
};

// EQ(bradley-terry), Bradley and Terry 1952, Luce 1959: P(i of S) = s_i / sum_{j in S} s_j. The
// strengths s, with a sum of 1, of largest likelihood, by Hunter's iteration (2004) s_i <- w_i
// / sum_{S with i} 1 / sum_{j in S} s_j, w_i the number of i's choices. A method that is never
// chosen has 0; where a method is always chosen against the others, the others have 0.
std::vector<double> BradleyTerry(const std::vector<Choice>& choices, int methods);

// 95 % intervals of BradleyTerry by bootstrap over participants: 1000 resamples of whole
// participants with a fixed seed, quantiles 2.5 % and 97.5 %. Empty for fewer than two.
std::vector<Interval> BradleyTerryIntervals(
    const std::vector<std::vector<Choice>>& participants, int methods);

}  // namespace regrade
