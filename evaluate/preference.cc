#include "evaluate/preference.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "kernels/base/error.h"
#include "kernels/base/random.h"

namespace regrade {
namespace {

constexpr double kTail = 0.025;
constexpr int kResamples = 1000;
constexpr uint64_t kSeed = 20230613;
constexpr int kIterations = 1000;
constexpr double kConverged = 1e-12;

// log of the binomial probability of k.
double LogProbability(int64_t k, int64_t n, double p) {
  const auto real = [](int64_t value) { return static_cast<double>(value); };
  return std::lgamma(real(n + 1)) - std::lgamma(real(k + 1)) - std::lgamma(real(n - k + 1)) +
         real(k) * std::log(p) + real(n - k) * std::log1p(-p);
}

// P(first <= X <= last), 0 < p < 1.
double Probability(int64_t first, int64_t last, int64_t n, double p) {
  double sum = 0;
  for (int64_t k = first; k <= last; ++k) sum += std::exp(LogProbability(k, n, p));
  return sum;
}

// The root of a function that rises from below kTail to above it on (0, 1).
double Bisect(const std::function<double(double)>& rising) {
  double low = 0, high = 1;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (rising(middle) < kTail ? low : high) = middle;
  }
  return (low + high) / 2;
}

}  // namespace

Interval BinomialInterval(int64_t successes, int64_t trials) {
  REGRADE_CHECK(trials >= 1 && successes >= 0 && successes <= trials);
  Interval interval{0, 1};
  if (successes > 0)
    interval.low = Bisect([&](double p) { return Probability(successes, trials, trials, p); });
  if (successes < trials)
    interval.high =
        1 - Bisect([&](double q) { return Probability(0, successes, trials, 1 - q); });
  return interval;
}

double SignTest(int64_t successes, int64_t trials) {
  REGRADE_CHECK(trials >= 1 && successes >= 0 && successes <= trials);
  const int64_t fewer = std::min(successes, trials - successes);
  if (2 * fewer == trials) return 1;
  return std::min(1.0, 2 * Probability(0, fewer, trials, 0.5));
}

std::vector<double> BradleyTerry(const std::vector<Choice>& choices, int methods) {
  std::vector<double> wins(methods), strength(methods, 1.0 / methods);
  for (const Choice& choice : choices) wins[choice.chosen] += 1;
  for (int iteration = 0; iteration < kIterations && !choices.empty(); ++iteration) {
    std::vector<double> exposure(methods);
    for (const Choice& choice : choices) {
      double sum = 0;
      for (const int i : choice.shown) sum += strength[i];
      if (!(sum > 0)) continue;
      for (const int i : choice.shown) exposure[i] += 1 / sum;
    }
    std::vector<double> next(methods);
    for (int i = 0; i < methods; ++i) next[i] = exposure[i] > 0 ? wins[i] / exposure[i] : 0;
    const double total = std::accumulate(next.begin(), next.end(), 0.0);
    double change = 0;
    for (int i = 0; i < methods; ++i) {
      next[i] /= total;
      change = std::max(change, std::abs(next[i] - strength[i]));
    }
    strength = next;
    if (change < kConverged) break;
  }
  return strength;
}

std::vector<Interval> BradleyTerryIntervals(
    const std::vector<std::vector<Choice>>& participants, int methods) {
  if (participants.size() < 2) return {};
  std::vector<std::vector<double>> strengths(methods);
  for (int resample = 0; resample < kResamples; ++resample) {
    std::vector<Choice> choices;
    for (size_t k = 0; k < participants.size(); ++k) {
      const auto& drawn = participants[RandomIndex(kSeed, resample, k, participants.size())];
      choices.insert(choices.end(), drawn.begin(), drawn.end());
    }
    const std::vector<double> strength = BradleyTerry(choices, methods);
    for (int i = 0; i < methods; ++i) strengths[i].push_back(strength[i]);
  }
  std::vector<Interval> intervals;
  for (std::vector<double>& values : strengths) {
    std::ranges::sort(values);
    const auto quantile = [&](double q) {
      return values[static_cast<size_t>(q * (kResamples - 1) + 0.5)];
    };
    intervals.push_back({quantile(kTail), quantile(1 - kTail)});
  }
  return intervals;
}

}  // namespace regrade
