// The guard reads a pipe whose other end nobody but us holds: the kernel closes it when we die,
// and closing is what the guard waits for.
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

// A copy of a process with many threads: system calls alone are safe in it.
[[noreturn]] void WaitForTheEnd(int end) {
  setpgid(0, 0);
  if (end > 0) close_range(0, static_cast<unsigned>(end) - 1, 0);
  close_range(static_cast<unsigned>(end) + 1, UINT_MAX, 0);
  char nothing;
  while (read(end, &nothing, 1) < 0 && errno == EINTR) {
  }
  kill(0, SIGKILL);  // the guard is of its group
  _exit(0);
}

}  // namespace

ProcessGuard::ProcessGuard() {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0)
    throw Error(ExitCode::kResources, std::string("cannot make a pipe: ") + strerror(errno));
  // Signals that end or stop us are for us to answer; the copy is born deaf to them.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  leader_ = _Fork();  // runs nobody's handlers for forks
  if (leader_ == 0) WaitForTheEnd(ends[0]);
  const int why = errno;
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  close(ends[0]);
  if (leader_ < 0) {
    close(ends[1]);
    throw Error(ExitCode::kResources, std::string("cannot start a process: ") + strerror(why));
  }
  life_ = ends[1];
  setpgid(leader_, leader_);  // whoever comes first: the group is there for its programs
}

ProcessGuard::~ProcessGuard() {
  Signal(SIGKILL);
  while (waitpid(leader_, nullptr, 0) < 0 && errno == EINTR) {
  }
  close(life_);
}

void ProcessGuard::Signal(int signal) const { kill(-leader_, signal); }

}  // namespace regrade
