// Jobs of a worker thread: their order, number and errors.
#include "pipeline/program/ordered_worker.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

namespace regrade {
namespace {

TEST(OrderedWorker, DoesAllJobsInOrder) {
  std::vector<int> done;
  OrderedWorker worker;
  for (int i = 0; i < 100; ++i) worker.Do([&done, i] { done.push_back(i); });
  worker.Finish();
  ASSERT_EQ(done.size(), 100u);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(done[static_cast<size_t>(i)], i);
}

// The number of jobs in memory is bounded: queued ones, the running one, and the offered one.
TEST(OrderedWorker, HoldsFewJobs) {
  std::atomic<int> held = 0, most = 0;
  struct Load {
    std::atomic<int>& held;
    Load(std::atomic<int>& held, std::atomic<int>& most) : held(held) {
      const int now = ++held;
      if (now > most) most = now;
    }
    ~Load() { --held; }
  };
  OrderedWorker worker(2);
  for (int i = 0; i < 50; ++i) {
    auto load = std::make_shared<Load>(held, most);
    worker.Do([load] { std::this_thread::sleep_for(std::chrono::milliseconds(1)); });
  }
  worker.Finish();
  EXPECT_LE(most, 4);
  EXPECT_EQ(held, 0);
}

TEST(OrderedWorker, AnErrorIsRethrownAndLaterJobsAreDropped) {
  std::atomic<int> done = 0;
  OrderedWorker worker;
  worker.Do([&done] { ++done; });
  worker.Do([] { throw std::runtime_error("the disk is full"); });
  EXPECT_THROW(
      {
        for (int i = 0; i < 10; ++i) worker.Do([&done] { ++done; });
        worker.Finish();
      },
      std::runtime_error);
  EXPECT_EQ(done, 1);
  EXPECT_THROW(worker.Finish(), std::runtime_error);
}

// The first job ends only when the queued ones are dropped: otherwise this would hang.
TEST(OrderedWorker, TheDestructorDropsQueuedJobs) {
  std::atomic<int> done = 0;
  std::atomic<bool> dropped = false;
  struct Dropped {
    std::atomic<bool>& flag;
    explicit Dropped(std::atomic<bool>& flag) : flag(flag) {}
    ~Dropped() { flag = true; }
  };
  {
    OrderedWorker worker(2);
    worker.Do([&] {
      while (!dropped) std::this_thread::yield();
      ++done;
    });
    auto token = std::make_shared<Dropped>(dropped);
    worker.Do([&done, token] { ++done; });
    worker.Do([&done, token = std::move(token)] { ++done; });
  }
  EXPECT_EQ(done, 1);
}

}  // namespace
}  // namespace regrade
