// Independent tasks in parallel, a whole frame or pair each: loops inside a task then run in
// its own thread, and no thread waits for others after each of them.
#pragma once

#include <omp.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <iterator>
#include <utility>
#include <vector>

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

// Calls use(i, make(i)) for i in [0, count) in order, in this thread; make is called for
// several at once, as many as there are threads and fit into 256 MiB at `bytes_each`.
template <typename Make, typename Use>
void MakeAhead(int64_t count, int64_t bytes_each, const Make& make, const Use& use) {
  const int64_t most = std::min(TasksAtOnce(bytes_each), int64_t{omp_get_max_threads()});
  for (int64_t begin = 0; begin < count; begin += most) {
    std::vector<decltype(make(begin))> made(static_cast<size_t>(std::min(most, count - begin)));
    ParallelTasks(0, std::ssize(made),
                  [&](int64_t k) { made[static_cast<size_t>(k)] = make(begin + k); });
    for (int64_t k = 0; k < std::ssize(made); ++k)
      use(begin + k, std::move(made[static_cast<size_t>(k)]));
  }
}

}  // namespace regrade
