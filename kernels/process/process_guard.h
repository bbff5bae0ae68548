// Kills a group of processes when this process dies, also by SIGKILL.
#pragma once

namespace regrade {

// A small process that leads a new process group and waits for the end of its parent. Programs
// that are started into its group, and their children, end with the parent; PR_SET_PDEATHSIG
// would cover one process only, and would fire at the end of the starting thread. The guard
// keeps no other file of the parent open. Throws Error(kResources) if processes or pipes run
// out.
class ProcessGuard {
 public:
  ProcessGuard();
  ~ProcessGuard();  // ends the group
  ProcessGuard(const ProcessGuard&) = delete;
  ProcessGuard& operator=(const ProcessGuard&) = delete;

  int group() const { return leader_; }
  void Signal(int signal) const;  // to the whole group; the guard itself blocks all but SIGKILL

 private:
  int leader_ = -1;
  int life_ = -1;  // write end of the guard's pipe
};

}  // namespace regrade
