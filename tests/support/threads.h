// The number of OpenMP threads within a scope, for tests.
#pragma once

#include <omp.h>

namespace regrade::testing {

struct Threads {
  explicit Threads(int n) : before(omp_get_max_threads()) { omp_set_num_threads(n); }
  ~Threads() { omp_set_num_threads(before); }
  Threads(const Threads&) = delete;
  Threads& operator=(const Threads&) = delete;
  int before;
};

}  // namespace regrade::testing
