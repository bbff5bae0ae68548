// The built program when its output is closed and when a signal stops it.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <string>

#include "pipeline/program/interrupt.h"
#include "tests/support/spawn.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::TemporaryFolder;

int Spawn(const std::vector<std::string>& arguments, int fd, int signal = 0,
          const std::string& when = "") {
  return testing::Spawn(REGRADE_PROGRAM, arguments, fd, signal, when);
}

TEST(Program, F24_ClosedOutputDoesNotStopTheProgram) {
  const TemporaryFolder folder;
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  ::close(ends[0]);
  EXPECT_EQ(
      Spawn({"synth", folder / "s", "--views", "2", "--size", "64x48", "--json"}, ends[1]), 0);
  EXPECT_TRUE(std::filesystem::exists(folder / "s/images/00001.png"));
  // The exit code is right, too.
  EXPECT_EQ(Spawn({"pose", folder / "none", "--out", folder / "out"}, ends[1]), 3);
  ::close(ends[1]);
}

TEST(Program, F34_DiesByTheSignalThatStoppedIt) {
  const TemporaryFolder folder;
  const int null = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  for (const int signal : {SIGINT, SIGTERM}) {
    const std::string out = folder / ("s" + std::to_string(signal));
    EXPECT_EQ(Spawn({"synth", out, "--views", "9999", "--size", "64x48"}, null, signal,
                    out + "/images/00000.png"),
              128 + signal);
  }
  ::close(null);
}

TEST(Interrupt, F34_TheSecondSignalEndsTheProcessAtOnce) {
  const pid_t child = ::fork();
  if (child == 0) {
    for (const int s : {SIGINT, SIGTERM}) ::signal(s, SIG_DFL);  // whatever was handed down
    InstallSignalHandling();
    ::raise(SIGINT);
    if (StopSignal() != SIGINT) ::_exit(1);  // the first is a request
    ::raise(SIGTERM);
    ::_exit(2);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGTERM) << status;
}

}  // namespace
}  // namespace regrade
