// Runs jobs one after the other in a thread: files and films are written while the next frames
// are rendered.
#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>

namespace regrade {

class OrderedWorker {
 public:
  // At most `most_waiting` jobs are queued, which bounds their memory.
  explicit OrderedWorker(size_t most_waiting = 2);
  // Waits for the current job and drops the queued ones, unless Finish was called.
  ~OrderedWorker();
  OrderedWorker(const OrderedWorker&) = delete;
  OrderedWorker& operator=(const OrderedWorker&) = delete;

  // Enqueues; blocks while the queue is full. Rethrows an exception of an earlier job, after
  // which no other job is run.
  void Do(std::function<void()> job);
  // Waits for all jobs; rethrows the exception of one of them.
  void Finish();

 private:
  void Work();
  void ThrowIfFailed();

  const size_t most_waiting_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> waiting_;
  bool at_work_ = false, stop_ = false;
  std::exception_ptr failure_;
  std::thread thread_;  // last: it uses the other members
};

}  // namespace regrade
