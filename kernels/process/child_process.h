// Starts another program without a shell, reads what it prints, and ends it when it is over
// time, silent for too long, or no longer wanted.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace regrade {

struct ChildOptions {
  // argv[0] is a path, or a name that is looked up on PATH. Nothing is ever parsed by a shell.
  std::vector<std::string> argv;
  std::string working_folder;  // empty: ours
  // Added to the minimal environment that a child gets (PATH, HOME, TMPDIR, LD_LIBRARY_PATH and
  // CUDA_VISIBLE_DEVICES where we have them; LC_ALL=C.UTF-8).
  std::vector<std::pair<std::string, std::string>> environment;
  double wall_limit_s = 0;   // 0: none
  double quiet_limit_s = 0;  // longest silence on stdout and stderr together; 0: none
  double grace_s = 5;        // between SIGTERM and SIGKILL
  std::string log_path;      // stdout and stderr as they came; empty: not kept
  int64_t log_cap_bytes = 16 << 20;
};

enum class ChildEnd { kExited, kSignal, kWallLimit, kQuietLimit, kStopped };

struct ChildResult {
  ChildEnd end = ChildEnd::kExited;
  int exit_status = 0;                  // for kExited
  int signal = 0;                       // what it died of; 0 if it exited by itself
  double seconds = 0;                   // wall clock
  std::vector<std::string> last_lines;  // at most 20

  bool Succeeded() const { return end == ChildEnd::kExited && exit_status == 0; }
  bool TimedOut() const { return end == ChildEnd::kWallLimit || end == ChildEnd::kQuietLimit; }
  std::string Describe() const;   // "exit status 1", "killed by signal 9 (Killed)", ...
  std::string LastLines() const;  // joined by newlines
};

// One line without its newline; lines longer than 4096 bytes come in pieces. Both callbacks run
// on the calling thread. If one throws, the child is ended before the exception goes on.
using LineFunction = std::function<void(const std::string& line)>;
// Asked about ten times a second, also while the child is silent; false ends the child.
using KeepGoingFunction = std::function<bool()>;

// Runs the program to its end. The child is in a process group of its own, so that its children
// end with it, and all of them with us, even by SIGKILL; its stdin is /dev/null; it inherits no
// other file of ours. Throws Error: kExternalProgram if it cannot be started (the reason in
// `what`), kResources if the system has no process, pipe or log space left.
ChildResult RunChild(const ChildOptions& options, const LineFunction& on_line = {},
                     const KeepGoingFunction& keep_going = {});

}  // namespace regrade
