// Parsing of untrusted files in a child process first.
#include "pipeline/program/crash_probe.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

#include "tests/support/expect_error.h"

namespace regrade {
namespace {

void Probe(const std::string& script, const CrashProbeLimits& limits = {}) {
  RunProbeCommand({"/bin/sh", "-c", script}, "net.onnx", limits);
}

TEST(CrashProbe, F73_ACrashBecomesAMessage) {
  EXPECT_REGRADE_ERROR(Probe("kill -SEGV $$"), ExitCode::kExternalProgram, "net.onnx");
  EXPECT_REGRADE_ERROR(Probe("kill -ABRT $$"), ExitCode::kExternalProgram,
                       "crashes the library that reads it (Aborted)");
}

TEST(CrashProbe, F73_TimeAndMemoryHaveLimits) {
  CrashProbeLimits limits;
  limits.seconds = 0.1;
  limits.memory_bytes = int64_t{4} << 30;
  // The second one ignores SIGTERM.
  for (const char* script : {"sleep 20", "trap '' TERM; sleep 20"})
    EXPECT_REGRADE_ERROR(Probe(script, limits), ExitCode::kExternalProgram, "did not end");
  limits.seconds = 60;
  EXPECT_REGRADE_ERROR(Probe("exit 99", limits), ExitCode::kExternalProgram,
                       "needs more than 4096 MiB");
}

#if !defined(__SANITIZE_ADDRESS__)
TEST(CrashProbe, F73_TheChildLimitsItsMemory) {
  const auto greedy = [] {
    ApplyProbeLimits(int64_t{4} << 30);
    try {
      volatile char* const much = new char[size_t{64} << 30];
      much[1] = 1;
    } catch (const std::bad_alloc&) {
      std::_Exit(5);
    }
    std::_Exit(0);
  };
  EXPECT_EXIT(greedy(), ::testing::ExitedWithCode(5), "");
}
#endif

TEST(CrashProbe, PlainErrorsAreLeftToTheCaller) {
  EXPECT_NO_THROW(Probe("exit 0"));
  EXPECT_NO_THROW(Probe("exit 3"));
  EXPECT_NO_THROW(Probe("exit 5"));
}

}  // namespace
}  // namespace regrade
