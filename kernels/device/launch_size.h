// Number of blocks of threads for a device kernel.
#pragma once

#include <cstdint>

namespace regrade {

inline constexpr int kThreads = 256;  // per block

inline unsigned BlocksFor(int64_t threads) {
  return static_cast<unsigned>((threads + kThreads - 1) / kThreads);
}

}  // namespace regrade
