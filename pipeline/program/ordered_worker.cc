#include "pipeline/program/ordered_worker.h"

#include <utility>

namespace regrade {

OrderedWorker::OrderedWorker(size_t most_waiting)
    : most_waiting_(most_waiting), thread_([this] { Work(); }) {}

OrderedWorker::~OrderedWorker() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    waiting_.clear();
  }
  changed_.notify_all();
  thread_.join();
}

void OrderedWorker::Do(std::function<void()> job) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return waiting_.size() < most_waiting_ || failure_; });
  ThrowIfFailed();
  waiting_.push_back(std::move(job));
  changed_.notify_all();
}

void OrderedWorker::Finish() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return (waiting_.empty() && !at_work_) || failure_; });
  ThrowIfFailed();
}

void OrderedWorker::ThrowIfFailed() {
  if (failure_) std::rethrow_exception(failure_);
}

void OrderedWorker::Work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return stop_ || !waiting_.empty(); });
    if (stop_) return;
    std::function<void()> job = std::move(waiting_.front());
    waiting_.pop_front();
    at_work_ = true;
    changed_.notify_all();  // the queue has room
    lock.unlock();
    std::exception_ptr failure;
    try {
      job();
    } catch (...) {
      failure = std::current_exception();
    }
    job = nullptr;  // frees its memory before another job is enqueued
    lock.lock();
    at_work_ = false;
    changed_.notify_all();
    if (!failure) continue;
    failure_ = failure;
    waiting_.clear();
    return;
  }
}

}  // namespace regrade
