#include "pipeline/program/memory.h"

#include <sys/resource.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <string>

namespace regrade {
namespace {

// The number after "Name:", in kB, as bytes.
uint64_t MemoryEntry(const std::string& line, const std::string& name) {
  if (!line.starts_with(name)) return 0;
  const size_t digits = line.find_first_of("0123456789");
  uint64_t kilobytes = 0;
  if (digits != std::string::npos)
    std::from_chars(line.data() + digits, line.data() + line.size(), kilobytes);
  return kilobytes << 10;
}

// A file with one number; "max" and missing files mean no limit.
uint64_t LimitIn(const char* path) {
  std::ifstream file(path);
  std::string text;
  uint64_t bytes = 0;
  if (std::getline(file, text)) std::from_chars(text.data(), text.data() + text.size(), bytes);
  return bytes;
}

}  // namespace

MemoryStatus ReadMemoryStatus() {
  MemoryStatus status;
  std::ifstream file("/proc/meminfo");
  for (std::string line; std::getline(file, line);) {
    status.total += MemoryEntry(line, "MemTotal:");
    status.available += MemoryEntry(line, "MemAvailable:");
  }
  const auto limit = [&status](uint64_t total, uint64_t used) {
    if (total == 0 || (status.total > 0 && total >= status.total)) return;
    status.total = total;
    status.available = std::min(status.available, total > used ? total - used : 0);
  };
  limit(LimitIn("/sys/fs/cgroup/memory.max"), LimitIn("/sys/fs/cgroup/memory.current"));
  rlimit address_space;
  if (::getrlimit(RLIMIT_AS, &address_space) == 0 && address_space.rlim_cur != RLIM_INFINITY)
    limit(address_space.rlim_cur, 0);
  rusage usage;
  if (::getrusage(RUSAGE_SELF, &usage) == 0)
    status.peak_used = static_cast<uint64_t>(usage.ru_maxrss) << 10;
  return status;
}

}  // namespace regrade
