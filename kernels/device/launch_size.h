// How many blocks of threads a device kernel gets.
#pragma once

#include <cstdint>

namespace regrade {

inline constexpr int kThreads = 256;  // a block

inline unsigned BlocksFor(int64_t threads) {
  return static_cast<unsigned>((threads + kThreads - 1) / kThreads);
}

}  // namespace regrade
