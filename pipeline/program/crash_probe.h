// Tries the parsing of an untrusted file in a child process first.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace regrade {

struct CrashProbeLimits {
  double seconds = 300;                      // wall clock
  int64_t memory_bytes = int64_t{32} << 30;  // of address space; not set under sanitizers
};

// First argument of the hidden form of the program that a probe runs:
// `regrade --probe MEMORY KIND FILE`, where MEMORY is the limit in bytes.
inline constexpr char kProbeFlag[] = "--probe";
// Exit status of a probe whose memory does not suffice.
inline constexpr int kProbeOutOfMemory = 99;

// Runs this program as `--probe MEMORY KIND FILE`. Returns if the child exits by itself, also
// with an error status: the caller then opens the file and reports the error. Throws
// Error(kExternalProgram) naming `file` if the child dies by a signal, runs out of memory, or
// exceeds the time limit; Interrupted if the user stops the program.
void RunCrashProbe(const std::string& kind, const std::string& file,
                   const CrashProbeLimits& limits = {});

// The same with a command of any program, for tests.
void RunProbeCommand(const std::vector<std::string>& command, const std::string& file,
                     const CrashProbeLimits& limits);

// Called in the child before it opens the file: limits the address space and forbids core
// dumps.
void ApplyProbeLimits(int64_t memory_bytes);

}  // namespace regrade
