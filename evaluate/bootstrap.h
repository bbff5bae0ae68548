// Block bootstrap confidence interval of a mean over frame pairs.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace regrade {

struct Interval {
  double low = 0, high = 0;
};

inline constexpr int kBootstrapResamples = 1000;

// EQ(block-bootstrap), circular block bootstrap (Politis and Romano 1992): a 95 %
// confidence interval of the mean of `values`. It is the 2.5 % and 97.5 % quantiles (linear
// between order statistics) of the means of 1000 resamples. Each resample has as many values as
// given, drawn as runs of `block` consecutive values with uniform random starts; a run that
// passes the end continues at the start.
//
// Pairs (i, i + gap) and (j, j + gap) cover overlapping parts of a film if |i - j| < gap, so
// their errors are correlated. Drawing single pairs would assume independence and give too
// narrow an interval; runs of `gap` keep most of the correlation. The interval is still
// slightly narrow: in simulated films of 60 pairs whose errors are sums over 5 neighbours, runs
// of 5 covered the true mean in 83 % of films and single pairs in 62 %; with independent errors
// it was 95 %. Correlation beyond a run (for example, one bad half of a film) is not modelled.
//
// `values` are in order of time; the interval has their unit. Empty for fewer than two runs.
// The same seed gives the same interval.
std::optional<Interval> BootstrapMean(const std::vector<double>& values, int block,
                                      uint64_t seed = 0);

}  // namespace regrade
