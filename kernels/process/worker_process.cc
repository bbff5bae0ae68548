// A pair of sockets: unlike pipes, one of them serves both ways, and its end is seen by poll().
#include "kernels/process/worker_process.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>
#include <system_error>
#include <thread>

#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "kernels/base/file_descriptor.h"

namespace regrade {
namespace {

constexpr int kMostWait = 60'000;  // of one call of poll, ms

pid_t Start(const std::vector<std::string>& argv, int socket) {
  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  if (posix_spawn_file_actions_init(&actions) != 0 || posix_spawnattr_init(&attributes) != 0)
    throw ResourceError("out of memory");
  posix_spawn_file_actions_adddup2(&actions, socket, STDIN_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addclosefrom_np(&actions, STDERR_FILENO + 1);
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(
      &attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  std::vector<char*> words;
  for (const std::string& word : argv) words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  pid_t pid = -1;
  const int status = posix_spawnp(&pid, words[0], &actions, &attributes, words.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  if (status == 0) return pid;
  const std::string what = "cannot start " + argv[0] + ": " + std::strerror(status);
  if (status == EAGAIN || status == ENOMEM) throw ResourceError(what);
  throw ProgramError(what);
}

// False if there is nothing by then.
bool Await(int socket, short events, double until) {
  for (;;) {
    const double left = std::ceil(1e3 * (until - ClockSeconds()));
    const int wait = static_cast<int>(std::clamp(left, 0.0, 1.0 * kMostWait));
    pollfd poll_for{socket, events, 0};
    const int ready = poll(&poll_for, 1, wait);
    if (ready > 0) return true;
    if (left <= 0 && ready == 0) return false;
  }
}

// Moves all bytes; `move` is one call that moves some.
template <typename Byte, typename Move>
WorkerProcess::Outcome MoveAll(int socket, Byte* at, size_t size, short events, double until,
                               const Move& move) {
  while (size > 0) {
    const ssize_t moved = move(at, size);
    if (moved > 0) {
      at += moved;
      size -= static_cast<size_t>(moved);
    } else if (moved < 0 && errno == EINTR) {
      continue;
    } else if (moved < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
      if (!Await(socket, events, until)) return WorkerProcess::Outcome::kLate;
    } else {
      return WorkerProcess::Outcome::kEnded;
    }
  }
  return WorkerProcess::Outcome::kDone;
}

constexpr double kForever = 1e300;

}  // namespace

WorkerProcess::WorkerProcess(const std::vector<std::string>& argv) {
  REGRADE_CHECK(!argv.empty());
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    throw ResourceError(std::string("cannot make a socket: ") + std::strerror(errno));
  FileDescriptor ours(ends[0]), theirs(ends[1]);
  pid_ = Start(argv, theirs.get());
  socket_ = ours.Release();
}

WorkerProcess::~WorkerProcess() { End(); }

bool WorkerProcess::IsIdle() const {
  char byte;
  return recv(socket_, &byte, 1, MSG_PEEK | MSG_DONTWAIT) < 0 &&
         (errno == EAGAIN || errno == EWOULDBLOCK);
}

WorkerProcess::Outcome WorkerProcess::Send(const void* data, size_t size, double until) {
  return MoveAll(socket_, static_cast<const char*>(data), size, POLLOUT, until,
                 [&](const char* at, size_t left) {
                   return send(socket_, at, left, MSG_NOSIGNAL | MSG_DONTWAIT);
                 });
}

WorkerProcess::Outcome WorkerProcess::Receive(void* data, size_t size, double until) {
  return MoveAll(socket_, static_cast<char*>(data), size, POLLIN, until,
                 [&](char* at, size_t left) { return recv(socket_, at, left, MSG_DONTWAIT); });
}

std::string WorkerProcess::End() {
  if (pid_ < 0) return "";
  // One that has crashed closes its socket before it can be waited for: it keeps its own
  // status, because a process that is ending already is not killed anew.
  kill(pid_, SIGKILL);
  int status = 0;
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  close(socket_);
  if (WIFSIGNALED(status)) return strsignal(WTERMSIG(status));
  return Concat("exit status ", WEXITSTATUS(status));
}

bool ReceiveFromStarter(void* data, size_t size) {
  return MoveAll(STDIN_FILENO, static_cast<char*>(data), size, POLLIN, kForever,
                 [](char* at, size_t left) { return recv(STDIN_FILENO, at, left, 0); }) ==
         WorkerProcess::Outcome::kDone;
}

bool SendToStarter(const void* data, size_t size) {
  return MoveAll(STDIN_FILENO, static_cast<const char*>(data), size, POLLOUT, kForever,
                 [](const char* at, size_t left) {
                   return send(STDIN_FILENO, at, left, MSG_NOSIGNAL);
                 }) == WorkerProcess::Outcome::kDone;
}

bool AwaitStarter(int milliseconds) {
  return Await(STDIN_FILENO, POLLIN, ClockSeconds() + 1e-3 * milliseconds);
}

void EndWithStarter() try {
  std::thread([] {
    pollfd end{STDIN_FILENO, 0, 0};
    while (poll(&end, 1, -1) <= 0 || (end.revents & (POLLHUP | POLLERR | POLLNVAL)) == 0) {
    }
    _exit(0);
  }).detach();
} catch (const std::system_error&) {
  // Without threads to spare, it ends when it next asks for something.
}

}  // namespace regrade
