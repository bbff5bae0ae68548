// A clock for durations.
#pragma once

#include <chrono>

namespace regrade {

// Seconds since some moment before the program started; never goes back.
inline double ClockSeconds() {
  const auto since = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration<double>(since).count();
}

}  // namespace regrade
