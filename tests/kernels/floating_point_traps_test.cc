// Checks that the traps of floating_point_traps.h are active.
#include "tests/support/floating_point_traps.h"

#include <gtest/gtest.h>

#include <csignal>

namespace regrade::testing {
namespace {

#if defined(__SANITIZE_ADDRESS__)
const ::testing::ExitedWithCode kTrapped(1);  // the sanitizer handles the signal and reports it
constexpr char kReport[] = "AddressSanitizer: FPE";
#else
const ::testing::KilledBySignal kTrapped(SIGFPE);
constexpr char kReport[] = "";
#endif

TEST(FloatingPointTrapsDeathTest, ADivisionByZeroEndsTheProgram) {
  volatile double zero = 0, result = 0;
  EXPECT_EXIT(result = 1 / zero, kTrapped, kReport);
  EXPECT_EXIT(result = zero / zero, kTrapped, kReport);
  const MayBeNotFinite allowed;
  result = 1 / zero;
  EXPECT_GT(result, 1);
}

}  // namespace
}  // namespace regrade::testing
