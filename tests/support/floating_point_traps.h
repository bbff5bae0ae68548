// Floating-point traps in tests of arithmetic: a division by zero, an overflow or an invalid
// operation ends the test program where it happens, also where its result would be looked at by
// nobody. Programs that have floating_point_traps.cc among their sources trap in every test.
#pragma once

namespace regrade::testing {

// While it lives, results may be infinite or no numbers: for tests that make such on purpose.
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
