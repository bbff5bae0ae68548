// Independent tasks in parallel, a whole frame or pair each: loops inside a task then run in
// its own thread, and no thread waits for others after each of them.
#pragma once

#include <omp.h>

#include <algorithm>
#include <cstdint>
#include <exception>

namespace regrade {

// Calls task(i) for i in [begin, end) in any order. The exception of the lowest i that threw is
// thrown again after all tasks have ended.
template <typename Task>
void ParallelTasks(int64_t begin, int64_t end, const Task& task) {
  std::exception_ptr failure;
  int64_t failed = end;
#pragma omp parallel for schedule(dynamic, 1)
  for (int64_t i = begin; i < end; ++i) {
    try {
      task(i);
    } catch (...) {
#pragma omp critical(regrade_parallel_tasks)
      if (i < failed) {
        failed = i;
        failure = std::current_exception();
      }
    }
  }
  if (failure) std::rethrow_exception(failure);
}

// How many tasks to start before their results are taken: enough that a slow one is not waited
// for, and few enough that progress shows and that `bytes_each` fit into 256 MiB; at least one.
inline int64_t TasksAtOnce(int64_t bytes_each) {
  const int64_t most = (int64_t{256} << 20) / std::max<int64_t>(1, bytes_each);
  return std::clamp<int64_t>(most, 1, 2 * std::max(1, omp_get_max_threads()));
}

}  // namespace regrade
