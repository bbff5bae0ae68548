// Work that may crash, in a child first.
#include "pipeline/program/crash_probe.h"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <thread>

#include "tests/support/expect_error.h"
#include "tests/support/process_state.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

TEST(CrashProbe, F73_ACrashBecomesAMessage) {
  EXPECT_REGRADE_ERROR(RunCrashProbe([] { ::raise(SIGSEGV); }, "net.onnx"),
                       ExitCode::kExternalProgram, "net.onnx");
  EXPECT_REGRADE_ERROR(RunCrashProbe([] { std::abort(); }, "net.onnx"),
                       ExitCode::kExternalProgram, "crashes");
}

TEST(CrashProbe, F73_TimeAndMemoryHaveLimits) {
  CrashProbeLimits limits;
  limits.seconds = 0.1;
  EXPECT_REGRADE_ERROR(
      RunCrashProbe([] { std::this_thread::sleep_for(std::chrono::seconds(60)); }, "slow.onnx",
                    limits),
      ExitCode::kExternalProgram, "did not end");
#if !defined(__SANITIZE_ADDRESS__)
  limits.seconds = 60;
  limits.memory_bytes = int64_t{4} << 30;
  const auto greedy = [] {
    volatile char* const much = new char[size_t{64} << 30];
    much[1] = 1;
    delete[] much;
  };
  EXPECT_REGRADE_ERROR(RunCrashProbe(greedy, "big.onnx", limits), ExitCode::kExternalProgram,
                       "MiB");
#endif
}

TEST(CrashProbe, F35_ACopyEndsWithAProcessThatIsKilled) {
  const testing::TemporaryFolder folder;
  const pid_t run = ::fork();
  if (run == 0) {
    RunCrashProbe(
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

TEST(CrashProbe, WhatAProgramCanGoOnFromPasses) {
  int touched = 0;
  RunCrashProbe([&] { touched = 1; }, "x");
  EXPECT_EQ(touched, 0);  // it was a copy
  RunCrashProbe([] { throw Error(ExitCode::kInput, "no", "y"); }, "x");
}

}  // namespace
}  // namespace regrade
