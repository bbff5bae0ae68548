// Work that a stranger's file may crash, tried in a child process first.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace regrade {

struct CrashProbeLimits {
  double seconds = 300;                      // of the wall clock
  int64_t memory_bytes = int64_t{32} << 30;  // of address space; not kept by sanitizers' builds
};

// Runs `work` in a copy of this process that has one thread and says nothing. Returns if it
// ended in whatever way a program may go on from, its own Errors included: the caller's own
// call will tell them. Throws Error(kExternalProgram) naming `where` if the copy died by a
// signal, and if it was ended because it took more time or memory than the limits.
void RunCrashProbe(const std::function<void()>& work, const std::string& where,
                   const CrashProbeLimits& limits = {});

}  // namespace regrade
