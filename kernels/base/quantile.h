// Quantiles of a list.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

namespace regrade {

// The value that floor(q n) of the n others are at most as large as, 0 <= q <= 1; 0 for an
// empty list.
template <typename T>
T Quantile(std::vector<T> values, double q) {
  if (values.empty()) return 0;
  const size_t k = std::min(values.size() - 1, static_cast<size_t>(q * values.size()));
  std::nth_element(values.begin(), values.begin() + k, values.end());
  return values[k];
}

// Of an even number of values, the larger of the two in the middle.
template <typename T>
T Median(std::vector<T> values) {
  return Quantile(std::move(values), 0.5);
}

}  // namespace regrade
