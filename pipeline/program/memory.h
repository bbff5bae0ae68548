// Total, available and used memory.
#pragma once

#include <cstdint>

namespace regrade {

struct MemoryStatus {
  uint64_t total = 0;      // bytes, of the machine or of the limit of this process
  uint64_t available = 0;  // bytes that can be used without swapping
  uint64_t peak_used = 0;  // bytes, maximum of this process
};

// From /proc/meminfo, the control group and the process's own limit; zero where unknown.
MemoryStatus ReadMemoryStatus();

}  // namespace regrade
