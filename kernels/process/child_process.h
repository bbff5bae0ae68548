// Runs another program without a shell, reads its output, and ends it on a time limit, a long
// silence, or cancellation.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace regrade {

struct ChildOptions {
  // argv[0] is a path or a name on PATH. No shell parses anything.
  std::vector<std::string> argv;
  std::string working_folder;  // empty: that of this process
  // Added to the child's minimal environment: PATH, HOME, LD_LIBRARY_PATH,
  // CUDA_VISIBLE_DEVICES, OMP_NUM_THREADS and OMP_WAIT_POLICY where set, LC_ALL=C.UTF-8, and
  // TMPDIR, a PrivateFolder that is removed at the child's end, unless one is given here.
  std::vector<std::pair<std::string, std::string>> environment;
  std::string temporary_parent;  // of that folder; empty: the system's temporary folder
  double wall_limit_s = 0;       // 0: none
  double quiet_limit_s = 0;      // longest silence on stdout and stderr together; 0: none
  double grace_s = 5;            // between SIGTERM and SIGKILL
  std::string log_path;          // gets stdout and stderr; empty: none
  int64_t log_cap_bytes = 16 << 20;
};

enum class ChildEnd { kExited, kSignal, kWallLimit, kQuietLimit, kStopped };

struct ChildResult {
  ChildEnd end = ChildEnd::kExited;
  int exit_status = 0;                  // for kExited
  int signal = 0;                       // that killed it; 0 if it exited
  double seconds = 0;                   // wall clock
  std::vector<std::string> last_lines;  // at most 20

  bool Succeeded() const { return end == ChildEnd::kExited && exit_status == 0; }
  bool TimedOut() const { return end == ChildEnd::kWallLimit || end == ChildEnd::kQuietLimit; }
  std::string Describe() const;   // "exit status 1", "killed by signal 9 (Killed)", ...
  std::string LastLines() const;  // each after a newline and two spaces
};

// Gets one line without its newline; lines above 4096 bytes come in pieces. Both callbacks run
// on the calling thread. If one throws, the child is ended before the exception propagates.
using LineFunction = std::function<void(const std::string& line)>;
// Called about ten times a second, also while the child is silent; false ends the child.
using KeepGoingFunction = std::function<bool()>;

// Runs the program to its end. The child has its own process group: its children end with it,
// and the group ends with this process, even if that is killed by SIGKILL. Its stdin is
// /dev/null; it inherits no other file. Throws Error(kExternalProgram) with the reason if it
// cannot be started, Error(kResources) if processes, pipes or space for the log run out.
ChildResult RunChild(const ChildOptions& options, const LineFunction& on_line = {},
                     const KeepGoingFunction& keep_going = {});

}  // namespace regrade
