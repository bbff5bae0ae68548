// The guard reads a pipe whose other end only the parent holds: the kernel closes it when the
// parent dies, and the read returns.
#include "kernels/process/process_guard.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <csignal>
#include <cstring>
#include <string>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// Runs in a forked copy of a process with many threads: only async-signal-safe functions may be
// called (setpgid, close_range, read, kill, _exit).
[[noreturn]] void WaitForTheEnd(int end) {
  setpgid(0, 0);
  if (end > 0) close_range(0, static_cast<unsigned>(end) - 1, 0);
  close_range(static_cast<unsigned>(end) + 1, UINT_MAX, 0);
  char nothing;
  while (read(end, &nothing, 1) < 0 && errno == EINTR) {
  }
  kill(0, SIGKILL);  // the guard is in its group
  _exit(0);
}

}  // namespace

ProcessGuard::ProcessGuard() {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0)
    throw ResourceError(std::string("cannot make a pipe: ") + strerror(errno));
  // The guard blocks all signals: only the parent reacts to them.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  leader_ = _Fork();  // runs no atfork handlers
  if (leader_ == 0) WaitForTheEnd(ends[0]);
  const int why = errno;
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  close(ends[0]);
  if (leader_ < 0) {
    close(ends[1]);
    throw ResourceError(std::string("cannot start a process: ") + strerror(why));
  }
  life_ = ends[1];
  setpgid(leader_, leader_);  // also here: the group must exist before its programs start
}

ProcessGuard::~ProcessGuard() {
  Signal(SIGKILL);
  while (waitpid(leader_, nullptr, 0) < 0 && errno == EINTR) {
  }
  close(life_);
}

void ProcessGuard::Signal(int signal) const { kill(-leader_, signal); }

}  // namespace regrade
