// Work that may crash, in a child first.
#include "pipeline/rehearsal.h"

#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <thread>

#include "tests/support/expect_error.h"

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

TEST(Rehearsal, WhatAProgramCanGoOnFromPasses) {
  int touched = 0;
  Rehearse([&] { touched = 1; }, "x");
  EXPECT_EQ(touched, 0);  // it was a copy
  Rehearse([] { throw Error(ExitCode::kInput, "no", "y"); }, "x");
}

}  // namespace
}  // namespace regrade
