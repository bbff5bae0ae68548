// Learning rates over time.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/base/host_device.h"

namespace regrade {

// EQ(cosine-annealing), Loshchilov and Hutter 2017, one period without restart:
//   rate(t) = last + (first - last) (1 + cos(pi t / (T - 1))) / 2,
// so that the first of T steps uses `first` and the last one exactly `last`. Beyond T it stays
// at `last` (the bare formula would rise again); T <= 1 gives `first`.
HD inline double CosineAnnealing(int64_t step, int64_t num_steps, double first, double last) {
  if (step <= 0 || num_steps <= 1) return first;
  if (step >= num_steps - 1) return last;
  using std::cos;
  const double phase = static_cast<double>(step) / static_cast<double>(num_steps - 1);
  return last + 0.5 * (first - last) * (1 + cos(M_PI * phase));
}

}  // namespace regrade
