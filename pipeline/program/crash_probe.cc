#include "pipeline/program/crash_probe.h"

#include <fcntl.h>
#include <omp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <new>
#include <thread>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr int kOutOfMemory = 3;  // exit status

void Limit(int64_t bytes) {
#if !defined(__SANITIZE_ADDRESS__)
  const rlimit limit{static_cast<rlim_t>(bytes), static_cast<rlim_t>(bytes)};
  ::setrlimit(RLIMIT_AS, &limit);
#else
  (void)bytes;
#endif
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
}

[[noreturn]] void RunChild(const std::function<void()>& work, const CrashProbeLimits& limits,
                           pid_t parent) {
  // It ends with us, also where we had ended before it could ask for that.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  const int nowhere = ::open("/dev/null", O_RDWR | O_CLOEXEC);
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(nowhere, fd);
  for (const int signal : {SIGINT, SIGTERM, SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL})
    ::signal(signal, SIG_DFL);
  Limit(limits.memory_bytes);
  // The parent's team of threads is not here.
  omp_set_num_threads(1);
  try {
    work();
  } catch (const std::bad_alloc&) {
    ::_exit(kOutOfMemory);
  } catch (...) {
    ::_exit(1);  // said by the caller's own call
  }
  ::_exit(0);
}

[[noreturn]] void Refuse(const std::string& what, const std::string& where) {
  throw Error(ExitCode::kExternalProgram, what, where,
              "the file is damaged, or not meant for this: take it from its source again");
}

}  // namespace

void RunCrashProbe(const std::function<void()>& work, const std::string& where,
                   const CrashProbeLimits& limits) {
  const pid_t parent = ::getpid(), child = ::fork();
  if (child < 0)
    throw Error(ExitCode::kResources,
                std::string("cannot start a process: ") + std::strerror(errno), where);
  if (child == 0) RunChild(work, limits, parent);
  const auto begin = std::chrono::steady_clock::now();
  int status = 0;
  bool late = false;
  for (;;) {
    const pid_t ended = ::waitpid(child, &status, late ? 0 : WNOHANG);
    if (ended == child) break;
    if (ended < 0 && errno != EINTR) return;
    if (!late && std::chrono::steady_clock::now() - begin >
                     std::chrono::duration<double>(limits.seconds)) {
      ::kill(child, SIGKILL);
      late = true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  if (late)
    Refuse("did not end within " + std::to_string(static_cast<int>(limits.seconds)) + " s",
           where);
  if (WIFSIGNALED(status))
    Refuse(std::string("crashes the library that reads it (") + ::strsignal(WTERMSIG(status)) +
               ")",
           where);
  if (WIFEXITED(status) && WEXITSTATUS(status) == kOutOfMemory)
    Refuse("asks for more than " + std::to_string(limits.memory_bytes >> 20) + " MiB", where);
}

}  // namespace regrade
