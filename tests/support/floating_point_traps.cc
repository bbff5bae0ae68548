// Threads inherit the traps of the one that starts them, so OpenMP's are covered as well.
#include "tests/support/floating_point_traps.h"

#include <gtest/gtest.h>

#include <cfenv>

namespace regrade::testing {
namespace {

constexpr int kTraps = FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW;

class Traps : public ::testing::EmptyTestEventListener {
  void OnTestStart(const ::testing::TestInfo&) override {
    std::feclearexcept(FE_ALL_EXCEPT);
    ::feenableexcept(kTraps);
  }
  void OnTestEnd(const ::testing::TestInfo&) override { ::fedisableexcept(kTraps); }
};

[[maybe_unused]] const bool appended = [] {
  ::testing::UnitTest::GetInstance()->listeners().Append(new Traps);
  return true;
}();

}  // namespace

MayBeNotFinite::MayBeNotFinite() : before_(::fedisableexcept(kTraps)) {}

MayBeNotFinite::~MayBeNotFinite() {
  std::feclearexcept(FE_ALL_EXCEPT);
  if (before_ > 0) ::feenableexcept(before_);
}

}  // namespace regrade::testing
