// How much memory there is, and how much of it we may use.
#pragma once

#include <cstdint>

namespace regrade {

struct MemoryStatus {
  uint64_t total = 0;      // bytes, of the machine or of the limit we run under
  uint64_t available = 0;  // bytes that can be had without pushing others out
  uint64_t peak_used = 0;  // bytes, the most that this process has had
};

// From /proc/meminfo, the control group and the process's own limit; zeros where nothing is
// known.
MemoryStatus ReadMemoryStatus();

}  // namespace regrade
