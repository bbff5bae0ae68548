// That the traps of floating_point_traps.h are there.
#include "tests/support/floating_point_traps.h"

#include <gtest/gtest.h>

#include <csignal>

namespace regrade::testing {
namespace {

TEST(FloatingPointTrapsDeathTest, ADivisionByZeroEndsTheProgram) {
  volatile double zero = 0, result = 0;
  EXPECT_EXIT(result = 1 / zero, ::testing::KilledBySignal(SIGFPE), "");
  EXPECT_EXIT(result = zero / zero, ::testing::KilledBySignal(SIGFPE), "");
  const MayBeNotFinite allowed;
  result = 1 / zero;
  EXPECT_GT(result, 1);
}

}  // namespace
}  // namespace regrade::testing
