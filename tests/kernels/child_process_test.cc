// Child processes that hang, flood, crash, ignore signals or leave children.
#include "kernels/process/child_process.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "kernels/base/error.h"
#include "tests/support/expect_error.h"
#include "tests/support/process_state.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

// The child's behaviour is written in sh. All hanging scripts end after a while, so that a
// failing test leaves no process behind.
ChildOptions Shell(const std::string& script) { return {.argv = {"/bin/sh", "-c", script}}; }

std::vector<std::string> LinesOf(const ChildOptions& options) {
  std::vector<std::string> lines;
  RunChild(options, [&](const std::string& line) { lines.push_back(line); });
  return lines;
}

std::string FileText(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

std::string TemporaryFile(const std::string& name) {
  const fs::path folder =
      fs::temp_directory_path() / ("child_process_test_" + std::to_string(getpid()));
  fs::create_directories(folder);
  return folder / name;
}

TEST(ChildProcess, ExitStatusAndBothOutputs) {
  std::vector<std::string> lines;
  const ChildResult result = RunChild(Shell("echo out; echo err >&2; printf end; exit 3"),
                                      [&](const std::string& line) { lines.push_back(line); });
  EXPECT_EQ(result.end, ChildEnd::kExited);
  EXPECT_EQ(result.exit_status, 3);
  EXPECT_FALSE(result.Succeeded());
  EXPECT_EQ(lines, (std::vector<std::string>{"out", "err", "end"}));
  EXPECT_EQ(result.LastLines(), "\n  out\n  err\n  end");
}

TEST(ChildProcess, F45_MissingProgramIsAnErrorWithTheReason) {
  EXPECT_REGRADE_ERROR(RunChild({.argv = {"/no/such/program"}}), ExitCode::kExternalProgram,
                       "No such file");
  EXPECT_THROW(RunChild({.argv = {"/etc/passwd"}}), Error);  // there, but not executable
}

TEST(ChildProcess, F45_NoZombieStays) {
  pid_t pid = 0;
  RunChild(Shell("echo $$"), [&](const std::string& line) { pid = std::atoi(line.c_str()); });
  ASSERT_GT(pid, 1);
  EXPECT_EQ(kill(pid, 0), -1);  // a zombie would still exist
}

TEST(ChildProcess, F49_DeathBySignalIsNamed) {
  const ChildResult result = RunChild(Shell("echo before; kill -SEGV $$"));
  EXPECT_EQ(result.end, ChildEnd::kSignal);
  EXPECT_EQ(result.signal, SIGSEGV);
  EXPECT_NE(result.Describe().find("Segmentation fault"), std::string::npos);
  EXPECT_EQ(result.LastLines(), "\n  before");
}

TEST(ChildProcess, F50_HangEndsAtTheWallLimit) {
  ChildOptions options = Shell("for i in $(seq 400); do echo busy; sleep 0.05; done");
  options.wall_limit_s = 0.5;
  options.quiet_limit_s = 5;
  const ChildResult result = RunChild(options);
  EXPECT_EQ(result.end, ChildEnd::kWallLimit);
  EXPECT_TRUE(result.TimedOut());
  EXPECT_LT(result.seconds, 4);
}

TEST(ChildProcess, F50_SilenceEndsAtTheQuietLimit) {
  ChildOptions options = Shell("echo started; exec sleep 30");
  options.quiet_limit_s = 0.4;
  const ChildResult result = RunChild(options);
  EXPECT_EQ(result.end, ChildEnd::kQuietLimit);
  EXPECT_LT(result.seconds, 4);
}

TEST(ChildProcess, F50_IgnoringSigtermIsKilledAfterTheGrace) {
  ChildOptions options = Shell("trap '' TERM; for i in $(seq 400); do sleep 0.05; done");
  options.wall_limit_s = 0.3;
  options.grace_s = 0.3;
  const ChildResult result = RunChild(options);
  EXPECT_EQ(result.end, ChildEnd::kWallLimit);
  EXPECT_EQ(result.signal, SIGKILL);
  EXPECT_LT(result.seconds, 4);
}

TEST(ChildProcess, F50_GrandchildrenEndWithTheGroup) {
  // The grandchild prints its number, outlives its parent and holds the pipe open.
  pid_t pid = 0;
  const ChildResult result = RunChild(Shell("sleep 60 & echo $!; exit 0"),
                                      [&](const auto& line) { pid = std::atoi(line.c_str()); });
  EXPECT_TRUE(result.Succeeded());
  EXPECT_LT(result.seconds, 4);
  ASSERT_GT(pid, 1);
  EXPECT_TRUE(testing::Ends(pid));
}

// SIGKILL allows no clean-up: a child that ignores SIGTERM, and its own child, end
// nevertheless, and no process of the group remains.
TEST(ChildProcess, F35_ChildrenEndWithAProcessThatIsKilled) {
  const fs::path child_file = TemporaryFile("child"), grandchild_file = TemporaryFile("grand");
  const pid_t copy = fork();
  if (copy == 0) {
    RunChild(Shell("trap '' TERM HUP; sleep 60 & echo $! > '" + grandchild_file.string() +
                   "'; echo $$ > '" + child_file.string() + "'; wait"));
    _exit(0);
  }
  const pid_t child = testing::NumberIn(child_file),
              grandchild = testing::NumberIn(grandchild_file);
  ASSERT_GT(child, 1);
  ASSERT_GT(grandchild, 1);
  const pid_t group = getpgid(child);
  EXPECT_TRUE(testing::IsAlive(child) && testing::IsAlive(grandchild));
  EXPECT_NE(group, getpgid(copy));
  kill(copy, SIGKILL);
  waitpid(copy, nullptr, 0);
  EXPECT_TRUE(testing::Ends(child));
  EXPECT_TRUE(testing::Ends(grandchild));
  EXPECT_TRUE(testing::Ends(group));  // the guard, whose number the group has
  kill(-group, SIGKILL);              // leave no process behind if the test fails
  fs::remove_all(child_file.parent_path());
}

// The guard holds no inherited descriptor open: locks and pipes of a killed process are
// released.
TEST(ChildProcess, F35_TheGuardHoldsNoInheritedFile) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  // The group's number is the guard's pid; a new guard needs a moment to close descriptors.
  EXPECT_EQ(LinesOf(Shell("guard=$(cut -d' ' -f5 /proc/$$/stat); for i in $(seq 100); do "
                          "n=$(ls /proc/$guard/fd | wc -l); [ $n = 1 ] && break; sleep 0.05; "
                          "done; echo $n")),
            std::vector<std::string>{"1"});
  close(ends[0]);
  close(ends[1]);
}

TEST(ChildProcess, StopsWhenCancelled) {
  int asked = 0;
  const ChildResult result = RunChild(Shell("exec sleep 30"), {}, [&] { return ++asked < 3; });
  EXPECT_EQ(result.end, ChildEnd::kStopped);
  EXPECT_LT(result.seconds, 4);
}

TEST(ChildProcess, AnExceptionInTheCallbackEndsTheChild) {
  pid_t pid = 0;
  EXPECT_THROW(RunChild(Shell("echo $$; exec sleep 30"),
                        [&](const std::string& line) {
                          pid = std::atoi(line.c_str());
                          throw Interrupted();
                        }),
               Interrupted);
  EXPECT_EQ(kill(pid, 0), -1);
}

TEST(ChildProcess, F52_AFloodIsDrainedAndTheLogCapped) {
  ChildOptions options = Shell(
      "i=0; while [ $i -lt 400 ]; do printf '%01000d\\n' $i; i=$((i+1)); done; echo last "
      "words");
  options.log_path = TemporaryFile("flood.log");
  options.log_cap_bytes = 10000;
  size_t lines = 0;
  const ChildResult result = RunChild(options, [&](const std::string&) { ++lines; });
  EXPECT_TRUE(result.Succeeded());
  EXPECT_EQ(lines, 401u);
  const std::string log = FileText(options.log_path);
  EXPECT_LT(log.size(), 10000u + 20 * 1001 + 100);  // the cap and the last 20 lines
  EXPECT_NE(log.find("log cut here"), std::string::npos);
  EXPECT_NE(log.find("last words"), std::string::npos);
  fs::remove_all(fs::path(options.log_path).parent_path());
}

TEST(ChildProcess, F52_ALineWithoutEndComesInPieces) {
  size_t longest = 0, bytes = 0;
  RunChild(Shell("head -c 1000000 /dev/zero"), [&](const std::string& line) {
    longest = std::max(longest, line.size());
    bytes += line.size();
  });
  EXPECT_EQ(longest, 4096u);
  EXPECT_EQ(bytes, 1000000u);
}

TEST(ChildProcess, F53_StdinIsEmpty) {
  const int before = dup(STDIN_FILENO);
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  ASSERT_EQ(write(ends[1], "for us\n", 7), 7);
  close(ends[1]);
  dup2(ends[0], STDIN_FILENO);
  close(ends[0]);
  EXPECT_EQ(LinesOf(Shell("cat; echo done")), std::vector<std::string>{"done"});
  dup2(before, STDIN_FILENO);
  close(before);
}

TEST(ChildProcess, F54_ArgumentsAreNeverParsed) {
  const std::string odd = "a b;$(touch x) '\"* \\ `id`";
  EXPECT_EQ(LinesOf({.argv = {"printf", "%s\n", odd}}), std::vector<std::string>{odd});
}

TEST(ChildProcess, F57_EnvironmentIsMinimal) {
  setenv("REGRADE_TEST_SECRET", "leaks", 1);
  ChildOptions options = {.argv = {"env"}, .environment = {{"EXTRA", "yes"}}};
  bool extra = false, locale = false;
  for (const std::string& line : LinesOf(options)) {
    EXPECT_EQ(line.find("REGRADE_TEST_SECRET"), std::string::npos);
    extra |= line == "EXTRA=yes";
    locale |= line == "LC_ALL=C.UTF-8";
  }
  EXPECT_TRUE(extra);
  EXPECT_TRUE(locale);
}

TEST(ChildProcess, F57_InheritsNoOpenFile) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);  // without O_CLOEXEC, as some libraries do
  for (const std::string& line : LinesOf(Shell("ls /proc/self/fd")))
    EXPECT_LE(std::atoi(line.c_str()), 3) << line;  // 3 is the folder that ls reads
  close(ends[0]);
  close(ends[1]);
}

TEST(ChildProcess, WorkingFolder) {
  ChildOptions options = {.argv = {"pwd"}, .working_folder = "/"};
  EXPECT_EQ(LinesOf(options), std::vector<std::string>{"/"});
}

}  // namespace
}  // namespace regrade
