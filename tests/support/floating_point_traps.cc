// A thread inherits the traps of the thread that starts it, and OpenMP's threads live on for
// later tests: traps are switched in all of them.
#include "tests/support/floating_point_traps.h"

#include <gtest/gtest.h>

#include <cfenv>

namespace regrade::testing {
namespace {

constexpr int kTraps = FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW;

void TrapInAllThreads(bool on) {
#pragma omp parallel
  {
    std::feclearexcept(FE_ALL_EXCEPT);
    if (on)
      ::feenableexcept(kTraps);
    else
      ::fedisableexcept(kTraps);
  }
}

class Traps : public ::testing::EmptyTestEventListener {
  void OnTestStart(const ::testing::TestInfo&) override { TrapInAllThreads(true); }
  void OnTestEnd(const ::testing::TestInfo&) override { TrapInAllThreads(false); }
};

[[maybe_unused]] const bool appended = [] {
  ::testing::UnitTest::GetInstance()->listeners().Append(new Traps);
  return true;
}();

}  // namespace

MayBeNotFinite::MayBeNotFinite() : trapped_((::fegetexcept() & kTraps) != 0) {
  TrapInAllThreads(false);
}

MayBeNotFinite::~MayBeNotFinite() { TrapInAllThreads(trapped_); }

}  // namespace regrade::testing
