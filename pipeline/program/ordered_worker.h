// A thread that does jobs one after the other while its owner makes the next: files and films
// are written while frames are rendered.
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
  // Jobs wait in a line of at most `most_waiting`, which bounds the memory that they hold.
  explicit OrderedWorker(size_t most_waiting = 2);
  // Waits for the job at hand; those behind it are dropped, unless Finish was called.
  ~OrderedWorker();
  OrderedWorker(const OrderedWorker&) = delete;
  OrderedWorker& operator=(const OrderedWorker&) = delete;

  // Takes its place in the line; waits while that is full. Throws what an earlier job has
  // thrown, after which no other job is done.
  void Do(std::function<void()> job);
  // Waits for all jobs; throws what one of them has thrown.
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
  std::thread thread_;  // last: it uses the others
};

}  // namespace regrade
