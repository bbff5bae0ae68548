#include "evaluate/bootstrap.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "kernels/base/random.h"

namespace regrade {
namespace {

double InterpolatedQuantile(const std::vector<double>& sorted, double fraction) {
  const double at = fraction * static_cast<double>(sorted.size() - 1);
  const size_t below = static_cast<size_t>(at);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (at - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

double MeanOfResample(const std::vector<double>& values, size_t block, uint64_t seed,
                      uint64_t resample) {
  double sum = 0;
  size_t begin = 0;
  for (size_t drawn = 0; drawn < values.size(); ++drawn) {
    if (drawn % block == 0) begin = RandomIndex(seed, resample, drawn / block, values.size());
    sum += values[(begin + drawn % block) % values.size()];
  }
  return sum / static_cast<double>(values.size());
}

}  // namespace

std::optional<Interval> BootstrapMean(const std::vector<double>& values, int block,
                                      uint64_t seed) {
  REGRADE_CHECK(block >= 1);
  if (values.size() < 2 * static_cast<size_t>(block)) return std::nullopt;
  std::vector<double> means(kBootstrapResamples);
  for (size_t r = 0; r < means.size(); ++r)
    means[r] = MeanOfResample(values, static_cast<size_t>(block), seed, r);
  std::ranges::sort(means);
  return Interval{InterpolatedQuantile(means, 0.025), InterpolatedQuantile(means, 0.975)};
}

}  // namespace regrade
