// Ends a group of processes when this one dies, however it dies: also by SIGKILL.
#pragma once

namespace regrade {

// A small process that leads a new process group and waits for our end. Programs that are
// started into its group end with us, and all that they have started: what PR_SET_PDEATHSIG
// would do for one process alone, and at the end of the thread that started it. Nothing else of
// ours stays open in it, no lock, no pipe. Throws Error kResources if there is no process or
// pipe left.
class ProcessGuard {
 public:
  ProcessGuard();
  ~ProcessGuard();  // ends the group
  ProcessGuard(const ProcessGuard&) = delete;
  ProcessGuard& operator=(const ProcessGuard&) = delete;

  int group() const { return leader_; }
  void Signal(int signal) const;  // to the whole group; the guard itself heeds SIGKILL alone

 private:
  int leader_ = -1;
  int life_ = -1;  // the end of a pipe that is open as long as we live
};

}  // namespace regrade
