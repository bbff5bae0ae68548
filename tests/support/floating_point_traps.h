// Floating-point traps in tests of arithmetic: a division by zero, an overflow or an invalid
// operation ends the test program where it happens, even if its result is never used. Programs
// with floating_point_traps.cc among their sources trap in every test.
#pragma once

namespace regrade::testing {

// During its lifetime results may be infinite or NaN: for tests that produce them on purpose.
class MayBeNotFinite {
 public:
  MayBeNotFinite();
  ~MayBeNotFinite();
  MayBeNotFinite(const MayBeNotFinite&) = delete;
  MayBeNotFinite& operator=(const MayBeNotFinite&) = delete;

 private:
  bool trapped_;
};

}  // namespace regrade::testing
