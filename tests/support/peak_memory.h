// Peak memory of this process, as Linux counts it.
#pragma once

#include <cstdint>
#include <fstream>
#include <string>

namespace regrade::testing {

// Largest resident memory since ResetPeakMemory, bytes; 0 where the kernel does not tell.
inline int64_t PeakMemory() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::stoll(line.substr(6)) << 10;
  return 0;
}

// The peak becomes what is resident now. Returns false where the kernel does not allow that.
inline bool ResetPeakMemory() {
  return static_cast<bool>(std::ofstream("/proc/self/clear_refs") << "5\n" << std::flush);
}

}  // namespace regrade::testing
