// Work that may crash, in a child first.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <thread>

#include "pipeline/program/crash_probe.h"
#include "tests/support/expect_error.h"
#include "tests/support/process_state.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

TEST(Rehearsal, F73_ACrashBecomesAMessage) {
  EXPECT_REGRADE_ERROR(Rehearse([] { ::raise(SIGSEGV); }, "net.onnx"),
                       ExitCode::kExternalProgram, "net.onnx");
  EXPECT_REGRADE_ERROR(Rehearse([] { std::abort(); }, "net.onnx"), ExitCode::kExternalProgram,
                       "crashes");
}

TEST(Rehearsal, F73_TimeAndMemoryHaveLimits) {
  RehearsalLimits limits;
  limits.seconds = 0.1;
  EXPECT_REGRADE_ERROR(Rehearse([] { std::this_thread::sleep_for(std::chrono::seconds(60)); },
                                "slow.onnx", limits),
                       ExitCode::kExternalProgram, "did not end");
#if !defined(__SANITIZE_ADDRESS__)
  limits.seconds = 60;
  limits.memory_bytes = int64_t{4} << 30;
  const auto greedy = [] {
    volatile char* const much = new char[size_t{64} << 30];
    much[1] = 1;
    delete[] much;
  };
  EXPECT_REGRADE_ERROR(Rehearse(greedy, "big.onnx", limits), ExitCode::kExternalProgram, "MiB");
#endif
}

TEST(Rehearsal, F35_ACopyEndsWithAProcessThatIsKilled) {
  const testing::TemporaryFolder folder;
  const pid_t run = ::fork();
  if (run == 0) {
    Rehearse(
        [&] {
          std::ofstream(folder / "copy") << ::getpid() << "\n";
          std::this_thread::sleep_for(std::chrono::seconds(60));
        },
        "x");
    ::_exit(0);
  }
  const pid_t copy = testing::NumberIn(folder / "copy");
  ASSERT_GT(copy, 1);
  ::kill(run, SIGKILL);
  ::waitpid(run, nullptr, 0);
  EXPECT_TRUE(testing::Ends(copy));
}

TEST(Rehearsal, WhatAProgramCanGoOnFromPasses) {
  int touched = 0;
  Rehearse([&] { touched = 1; }, "x");
  EXPECT_EQ(touched, 0);  // it was a copy
  Rehearse([] { throw Error(ExitCode::kInput, "no", "y"); }, "x");
}

}  // namespace
}  // namespace regrade
