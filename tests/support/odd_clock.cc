// A library to preload: the wall clock is in the year 2106 and jumps back and forth by days
// between two readings. The monotonic clock is unchanged.
#include <dlfcn.h>
#include <sys/time.h>
#include <time.h>

#include <atomic>

namespace {

constexpr long kYear2106 = 4294967296;  // seconds: beyond 32 bits
std::atomic<long> readings{0};

long OddSeconds() {
  const long reading = ++readings;
  return kYear2106 + (reading % 2 == 0 ? 1 : -1) * reading * 86400;
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, struct timespec* now) {
  if (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE) {
    *now = {OddSeconds(), 0};
    return 0;
  }
  static const auto real =
      reinterpret_cast<int (*)(clockid_t, struct timespec*)>(dlsym(RTLD_NEXT, "clock_gettime"));
  return real(clock, now);
}

int gettimeofday(struct timeval* now, void*) noexcept {
  *now = {OddSeconds(), 0};
  return 0;
}

time_t time(time_t* now) noexcept {
  const time_t odd = OddSeconds();
  if (now != nullptr) *now = odd;
  return odd;
}

}  // extern "C"
