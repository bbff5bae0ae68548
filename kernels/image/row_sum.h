// Sums over the rows of an image, in parallel, with the same result for any number of threads.
#pragma once

#include <vector>

namespace regrade {

// `row(y)` gives a value with operator+=; the values are added in the order of the rows. `row`
// must not throw.
template <typename Row>
auto SumOverRows(int height, const Row& row) {
  using Value = decltype(row(0));
  std::vector<Value> partial(height);
#pragma omp parallel for schedule(static)
  for (int y = 0; y < height; ++y) partial[y] = row(y);
  Value sum{};
  for (const Value& value : partial) sum += value;
  return sum;
}

}  // namespace regrade
