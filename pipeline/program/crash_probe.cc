#include "pipeline/program/crash_probe.h"

#include <sys/resource.h>

#include <cstring>

#include "kernels/base/error.h"
#include "kernels/process/child_process.h"
#include "pipeline/program/interrupt.h"

namespace regrade {

void RunProbeCommand(const std::vector<std::string>& command, const std::string& file,
                     const CrashProbeLimits& limits) {
  ChildOptions options;
  options.argv = command;
  options.environment = {{"OMP_NUM_THREADS", "1"}};
  options.wall_limit_s = limits.seconds;
  options.grace_s = 0;
  const ChildResult result = RunChild(options, {}, [] { return !StopRequested(); });
  if (result.end == ChildEnd::kStopped) throw Interrupted();
  std::string problem;
  if (result.TimedOut())
    problem = Concat("did not end within ", static_cast<int>(limits.seconds), " s");
  else if (result.end == ChildEnd::kSignal)
    problem =
        std::string("crashes the library that reads it (") + ::strsignal(result.signal) + ")";
  else if (result.exit_status == kProbeOutOfMemory)
    problem = Concat("needs more than ", limits.memory_bytes >> 20, " MiB");
  if (!problem.empty())
    throw ProgramError(
        problem, file,
        "the file is damaged or has the wrong content: get it from its source again");
}

void RunCrashProbe(const std::string& kind, const std::string& file,
                   const CrashProbeLimits& limits) {
  RunProbeCommand(
      {"/proc/self/exe", kProbeFlag, std::to_string(limits.memory_bytes), kind, file}, file,
      limits);
}

void ApplyProbeLimits(int64_t memory_bytes) {
#if !defined(__SANITIZE_ADDRESS__)
  const rlimit limit{static_cast<rlim_t>(memory_bytes), static_cast<rlim_t>(memory_bytes)};
  ::setrlimit(RLIMIT_AS, &limit);
#else
  (void)memory_bytes;
#endif
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
}

}  // namespace regrade
