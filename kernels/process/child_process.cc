// posix_spawn, one pipe for both outputs, and a loop that reads it and checks the time limits.
#include "kernels/process/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <optional>

#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "kernels/base/file_descriptor.h"
#include "kernels/process/private_folder.h"
#include "kernels/process/process_guard.h"

namespace regrade {
namespace {

constexpr size_t kLongestLine = 4096;
constexpr size_t kLastLines = 20;
constexpr int kPollMs = 100;

[[noreturn]] void ThrowNoResources(const std::string& what, int code) {
  throw ResourceError(what + ": " + std::strerror(code));
}

// Keeps the beginning of the output in a file, up to the cap, and the end in memory.
class Log {
 public:
  Log(const std::string& path, int64_t cap) : path_(path), left_(cap) {
    if (path.empty()) return;
    file_.Reset(OpenOwnFile(path, O_WRONLY | O_CREAT | O_TRUNC));
    if (file_.get() < 0) ThrowNoResources("cannot write the log " + path, errno);
  }

  void Append(const char* data, size_t size) {
    if (file_.get() < 0) return;
    const size_t kept = std::min<int64_t>(left_, static_cast<int64_t>(size));
    Write(data, kept);
    left_ -= static_cast<int64_t>(kept);
    cut_ |= kept < size;
  }

  // The last lines explain a failure best: they are appended after the cut.
  void Finish(const std::deque<std::string>& last_lines) {
    if (!cut_) return;
    std::string end = "\n[... log cut here; the last lines were:]\n";
    for (const std::string& line : last_lines) end += line + "\n";
    Write(end.data(), end.size());
  }

 private:
  // A log that cannot be written (full disk) must not stop the child.
  void Write(const char* data, size_t size) {
    while (size > 0) {
      const ssize_t written = write(file_.get(), data, size);
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) return;
      data += written;
      size -= static_cast<size_t>(written);
    }
  }

  std::string path_;
  FileDescriptor file_;
  int64_t left_;
  bool cut_ = false;
};

// Cuts a stream of bytes into lines; a carriage return ends a line as well (progress counters).
class Lines {
 public:
  Lines(const LineFunction& on_line, std::deque<std::string>* last)
      : on_line_(on_line), last_(last) {}

  void Append(const char* data, size_t size) {
    for (size_t i = 0; i < size; ++i) {
      if (data[i] == '\n' || data[i] == '\r')
        End();
      else if (line_.push_back(data[i]); line_.size() >= kLongestLine)
        End();
    }
  }
  void End() {
    if (line_.empty()) return;
    last_->push_back(line_);
    if (last_->size() > kLastLines) last_->pop_front();
    std::string line;
    line.swap(line_);
    if (on_line_) on_line_(line);
  }

 private:
  const LineFunction& on_line_;
  std::deque<std::string>* last_;
  std::string line_;
};

bool GivesTemporaryFolder(const ChildOptions& options) {
  return std::ranges::any_of(options.environment,
                             [](const auto& entry) { return entry.first == "TMPDIR"; });
}

std::vector<std::string> MinimalEnvironment(const ChildOptions& options,
                                            const std::string& temporary) {
  std::vector<std::string> environment;
  if (!temporary.empty()) environment.push_back("TMPDIR=" + temporary);
  for (const char* name : {"PATH", "HOME", "LD_LIBRARY_PATH", "CUDA_VISIBLE_DEVICES",
                           "OMP_NUM_THREADS", "OMP_WAIT_POLICY"})
    if (const char* value = std::getenv(name))
      environment.push_back(std::string(name) + "=" + value);
  environment.push_back("LC_ALL=C.UTF-8");
  for (const auto& [name, value] : options.environment)
    environment.push_back(name + "=" + value);
  return environment;
}

std::vector<char*> Pointers(const std::vector<std::string>& strings) {
  std::vector<char*> pointers;
  for (const std::string& s : strings) pointers.push_back(const_cast<char*>(s.c_str()));
  pointers.push_back(nullptr);
  return pointers;
}

// Owns a started child: the destructor kills its group and reaps it; if this process is killed,
// the group's guard kills the group.
class Child {
 public:
  // `temporary`: the child's TMPDIR; empty: what the options say.
  Child(const ChildOptions& options, const std::string& temporary, int output) {
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    if (posix_spawn_file_actions_init(&actions) != 0 || posix_spawnattr_init(&attributes) != 0)
      throw ResourceError("out of memory");
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, output, STDERR_FILENO);
    posix_spawn_file_actions_addclosefrom_np(&actions, STDERR_FILENO + 1);
    if (!options.working_folder.empty())
      posix_spawn_file_actions_addchdir_np(&actions, options.working_folder.c_str());
    // The child gets default signal handlers and an empty mask.
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &all);
    posix_spawnattr_setpgroup(&attributes, guard_.group());
    posix_spawnattr_setflags(
        &attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    const std::vector<std::string> environment = MinimalEnvironment(options, temporary);
    const int status =
        posix_spawnp(&pid_, options.argv[0].c_str(), &actions, &attributes,
                     Pointers(options.argv).data(), Pointers(environment).data());
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    if (status == 0) return;
    pid_ = -1;
    const std::string what = "cannot start " + options.argv[0];
    if (status == EAGAIN || status == ENOMEM) ThrowNoResources(what, status);
    throw ProgramError(what + ": " + std::strerror(status));
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() {
    if (pid_ > 0) Reap();
  }

  void Signal(int signal) const { guard_.Signal(signal); }

  // True once the child has ended.
  bool Ended() const {
    siginfo_t info{};
    return waitid(P_PID, pid_, &info, WEXITED | WNOHANG | WNOWAIT) != 0 || info.si_pid == pid_;
  }

  // Kills the rest of the group and returns the child's status.
  int Reap() {
    Signal(SIGKILL);
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
    return status;
  }

 private:
  ProcessGuard guard_;  // keeps the group's number in use while the child is
  pid_t pid_ = -1;
};

}  // namespace

std::string ChildResult::Describe() const {
  const std::string by_signal =
      signal == 0 ? "" : Concat("killed by signal ", signal, " (", strsignal(signal), ")");
  switch (end) {
    case ChildEnd::kExited:
      return "exit status " + std::to_string(exit_status);
    case ChildEnd::kSignal:
      return by_signal;
    case ChildEnd::kWallLimit:
      return Concat("ended after its time limit, ", std::lround(seconds), " s");
    case ChildEnd::kQuietLimit:
      return Concat("ended because it printed nothing for too long (it ran for ",
                    std::lround(seconds), " s)");
    case ChildEnd::kStopped:
      return "cancelled by the user";
  }
  return "";
}

std::string ChildResult::LastLines() const {
  std::string text;
  for (const std::string& line : last_lines) text += "\n  " + line;
  return text;
}

ChildResult RunChild(const ChildOptions& options, const LineFunction& on_line,
                     const KeepGoingFunction& keep_going) {
  REGRADE_CHECK(!options.argv.empty());
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) ThrowNoResources("cannot make a pipe", errno);
  FileDescriptor input(ends[0]), output(ends[1]);
  fcntl(input.get(), F_SETFL, O_NONBLOCK);
  Log log(options.log_path, options.log_cap_bytes);
  std::deque<std::string> last;
  Lines lines(on_line, &last);

  std::optional<PrivateFolder> temporary;  // outlives the child
  if (!GivesTemporaryFolder(options)) temporary.emplace(options.temporary_parent);

  const double start = ClockSeconds();
  Child child(options, temporary ? temporary->path() : "", output.get());
  output.Close();

  ChildResult result;
  double heard = start, asked = start, asked_to_end = 0, ended_since = 0;
  char bytes[1 << 16];
  while (true) {
    const double now = ClockSeconds();
    if (ended_since == 0 && child.Ended()) {
      child.Signal(SIGKILL);  // the rest of its group
      ended_since = now;
    }
    pollfd wait{input.get(), POLLIN, 0};
    const bool readable = poll(&wait, 1, ended_since > 0 ? 0 : kPollMs) > 0;
    const ssize_t size = readable ? read(input.get(), bytes, sizeof(bytes)) : 0;
    if (size > 0) {
      heard = now;
      log.Append(bytes, static_cast<size_t>(size));
      lines.Append(bytes, static_cast<size_t>(size));
    }
    if (ended_since > 0) {
      // A grandchild outside the group may keep the pipe open or fill it forever.
      if (size <= 0 || now - ended_since > 1) break;
      continue;
    }
    if (readable && size <= 0) usleep(kPollMs * 100);  // closed its outputs, but still runs
    if (asked_to_end > 0) {
      if (now - asked_to_end > options.grace_s) child.Signal(SIGKILL);
      continue;
    }
    if (keep_going && now - asked >= 1e-3 * kPollMs) {
      asked = now;
      if (!keep_going()) result.end = ChildEnd::kStopped;
    }
    if (options.wall_limit_s > 0 && now - start > options.wall_limit_s)
      result.end = ChildEnd::kWallLimit;
    if (options.quiet_limit_s > 0 && now - heard > options.quiet_limit_s)
      result.end = ChildEnd::kQuietLimit;
    if (result.end == ChildEnd::kExited) continue;  // no reason to end it
    child.Signal(SIGTERM);
    asked_to_end = now;
  }
  const int status = child.Reap();
  lines.End();
  log.Finish(last);
  result.seconds = ClockSeconds() - start;
  result.last_lines.assign(last.begin(), last.end());
  if (WIFSIGNALED(status)) {
    result.signal = WTERMSIG(status);
    if (result.end == ChildEnd::kExited) result.end = ChildEnd::kSignal;
  } else {
    result.exit_status = WEXITSTATUS(status);
  }
  return result;
}

}  // namespace regrade
