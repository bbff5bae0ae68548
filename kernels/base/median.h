// The median of a list.
#pragma once

#include <algorithm>
#include <vector>

namespace regrade {

// The larger of the two middle values of an even number; 0 for an empty list.
template <typename T>
T Median(std::vector<T> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace regrade
