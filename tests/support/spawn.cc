#include "tests/support/spawn.h"

#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <thread>

namespace regrade::testing {

int Spawn(const char* program, const std::vector<std::string>& arguments, int fd, int signal,
          const std::string& when) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::dup2(fd, STDOUT_FILENO);
    ::dup2(fd, STDERR_FILENO);
    // A test that runs as a background job ignores these signals, and children inherit that.
    for (const int s : {SIGINT, SIGTERM}) ::signal(s, SIG_DFL);
    std::vector<char*> argv = {const_cast<char*>(program)};
    for (const std::string& argument : arguments)
      argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    ::execv(program, argv.data());
    ::_exit(127);
  }
  if (signal != 0) {
    for (int i = 0; i < 30000 && !std::filesystem::exists(when); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    ::kill(child, signal);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace regrade::testing
