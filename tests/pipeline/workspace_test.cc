#include "pipeline/workspace/workspace.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <thread>

#include "pipeline/files/atomic_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

// Records the program's calls to the disk.
static std::vector<std::string>* disk_calls = nullptr;

extern "C" int fsync(int fd) {
  struct stat status = {};
  ::fstat(fd, &status);
  if (disk_calls) disk_calls->push_back(S_ISDIR(status.st_mode) ? "sync folder" : "sync file");
  return static_cast<int>(::syscall(SYS_fsync, fd));
}

extern "C" int rename(const char* from, const char* to) noexcept {
  if (disk_calls) disk_calls->push_back("rename");
  return ::renameat(AT_FDCWD, from, AT_FDCWD, to);
}

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::ReadText;
using testing::TemporaryFolder;
using testing::WriteText;

JsonValue Inputs(int value) {
  return JsonValue::Object{{"options", JsonValue::Object{{"fit-rays", value}, {"seed", 1}}}};
}

// Runs `body` in a child process; its exit status.
template <typename Body>
int InChild(const Body& body) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(body());
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

TEST(Workspace, FinishedStagesAreKnownAgain) {
  const TemporaryFolder folder;
  {
    Workspace workspace(folder / "out");
    EXPECT_EQ(workspace.Status("pose", Inputs(1)).state, StageState::kNeverDone);
    WriteText(workspace.Path("poses/a.bin"), "abc");
    workspace.Record("pose", Inputs(1), {"poses"}, 2.5, JsonValue::Object{{"points", 7}});
  }
  Workspace workspace(folder / "out");
  EXPECT_EQ(workspace.Status("pose", Inputs(1)).state, StageState::kDone);
  EXPECT_EQ(workspace.Find("pose")->metrics.At("points").AsInt(), 7);
  EXPECT_EQ(workspace.FinishedStages(), std::vector<std::string>{"pose"});
  workspace.Forget("pose");
  EXPECT_EQ(workspace.Status("pose", Inputs(1)).state, StageState::kNeverDone);
  EXPECT_TRUE(fs::exists(workspace.Path("poses/a.bin")));
}

TEST(Workspace, F40_DifferencesAreNamed) {
  const TemporaryFolder folder;
  Workspace workspace(folder / "out");
  WriteText(workspace.Path("field.npz"), "abc");
  workspace.Record("reconstruct", Inputs(4096), {"field.npz"}, 1, JsonValue::Object());
  const StageStatus status = workspace.Status("reconstruct", Inputs(8192));
  EXPECT_EQ(status.state, StageState::kInputsDiffer);
  EXPECT_EQ(status.why, std::vector<std::string>{"options fit-rays: was 4096, now 8192"});
}

TEST(Workspace, F40_ChangedPhotoSetIsSummarised) {
  const auto photos = [](std::vector<std::pair<std::string, int>> files) {
    JsonValue set = JsonValue::Object();
    for (const auto& [name, hash] : files) set[name] = hash;
    return JsonValue(JsonValue::Object{{"photos", set}});
  };
  EXPECT_EQ(
      Differences(photos({{"a.jpg", 1}, {"b.jpg", 2}}), photos({{"a.jpg", 1}, {"c.jpg", 3}})),
      (std::vector<std::string>{"photos b.jpg is gone", "photos c.jpg is new"}));
  EXPECT_EQ(Differences(photos({{"a.jpg", 1}}), photos({{"a.jpg", 2}})),
            std::vector<std::string>{"photos a.jpg: was 1, now 2"});
  std::vector<std::pair<std::string, int>> many;
  for (int i = 0; i < 100; ++i) many.emplace_back(std::to_string(i), i);
  const auto differences = Differences(photos({}), photos(many));
  EXPECT_EQ(differences.size(), 5u);
  EXPECT_EQ(differences.back(), "and 96 more differences of photos");
}

TEST(Workspace, F41_EditedAndDeletedResults) {
  const TemporaryFolder folder;
  Workspace workspace(folder / "out");
  WriteText(workspace.Path("poses/a.bin"), "abc");
  WriteText(workspace.Path("poses/b.bin"), "def");
  workspace.Record("pose", Inputs(1), {"poses"}, 1, JsonValue::Object());
  // Same length and time stamp: only the content differs.
  const auto time = fs::last_write_time(workspace.Path("poses/a.bin"));
  WriteText(workspace.Path("poses/a.bin"), "abd");
  fs::last_write_time(workspace.Path("poses/a.bin"), time);
  StageStatus status = workspace.Status("pose", Inputs(1));
  EXPECT_EQ(status.state, StageState::kResultsDiffer);
  EXPECT_EQ(status.why, std::vector<std::string>{"poses/a.bin has been changed"});
  WriteText(workspace.Path("poses/a.bin"), "abc");
  EXPECT_EQ(workspace.Status("pose", Inputs(1)).state, StageState::kDone);
  fs::remove(workspace.Path("poses/b.bin"));
  EXPECT_EQ(workspace.Status("pose", Inputs(1)).why,
            std::vector<std::string>{"poses/b.bin is gone"});
}

TEST(Workspace, F42_TheFolderCanMove) {
  const TemporaryFolder folder;
  {
    Workspace workspace(folder / "out");
    WriteText(workspace.Path("poses/a.bin"), "abc");
    workspace.Record("pose", Inputs(1), {"poses"}, 1, JsonValue::Object());
    workspace.SaveCheckpoint("reconstruct", Inputs(2), {"state"});
    EXPECT_EQ(ReadText(workspace.Path(".regrade/stages/pose.json")).find(folder.path()),
              std::string::npos);
  }
  fs::create_directories(folder / "else where");
  fs::rename(folder / "out", folder / "else where/moved");
  Workspace workspace(folder / "else where/moved");
  EXPECT_EQ(workspace.Status("pose", Inputs(1)).state, StageState::kDone);
  EXPECT_EQ(workspace.LoadCheckpoint("reconstruct", Inputs(2)), "state");
}

TEST(Workspace, RecordsOfOtherFormatsAreRefused) {
  const TemporaryFolder folder;
  Workspace workspace(folder / "out");
  const std::string path = workspace.Path(".regrade/stages/pose.json");
  WriteText(path, R"({"schema": 99, "regrade": "7.0"})");
  EXPECT_REGRADE_ERROR(workspace.Find("pose"), ExitCode::kInput, "written by regrade 7.0");
  EXPECT_REGRADE_ERROR(workspace.Find("pose"), ExitCode::kInput, "update regrade");
  WriteText(path, R"({"schema": 1, "regrade": "0.1.0"})");
  EXPECT_REGRADE_ERROR(workspace.Find("pose"), ExitCode::kInput,
                       "made by an older regrade (schema 1)");
  EXPECT_REGRADE_ERROR(workspace.Find("pose"), ExitCode::kInput, "--out");
}

TEST(Workspace, FoldersOfOlderSchemasAreRefused) {
  const TemporaryFolder folder;
  const std::string record = folder / "out/.regrade/stages/pose.json";
  WriteText(record, R"({"schema": 1, "regrade": "0.1.0"})");
  EXPECT_REGRADE_ERROR(Workspace(folder / "out"), ExitCode::kInput, "regrade (schema 1)");
  EXPECT_REGRADE_ERROR(Workspace(folder / "out"), ExitCode::kInput, "use another --out");
  WriteText(record, "{ \"schema\"");  // a damaged record concerns its stage only
  EXPECT_NO_THROW(Workspace(folder / "out"));
}

TEST(Workspace, RecordsCannotLeadOutOfTheFolder) {
  const TemporaryFolder folder;
  Workspace workspace(folder / "out");
  for (const char* path : {"../secret", "/etc/passwd", "a/../../b", "poses/"}) {
    WriteJsonFile(
        workspace.Path(".regrade/stages/pose.json"),
        JsonValue::Object{{"schema", 3},
                          {"regrade", "x"},
                          {"inputs", JsonValue::Object()},
                          {"outputs", JsonValue::Array{JsonValue::Object{
                                          {"path", path}, {"bytes", 1}, {"hash", "0"}}}},
                          {"seconds", 1},
                          {"metrics", JsonValue::Object()}});
    EXPECT_REGRADE_ERROR(workspace.Find("pose"), ExitCode::kInput, "leads out");
  }
}

TEST(Workspace, F37_LeftoversAreRemoved) {
  const TemporaryFolder folder;
  { const Workspace workspace(folder / "out"); }
  WriteText(folder / ("out/frames/styled/00001.png" + std::string(kTemporarySuffix)), "half");
  WriteText(folder / "out/frames/styled/00000.png", "whole");
  const Workspace workspace(folder / "out");
  EXPECT_FALSE(
      fs::exists(folder / ("out/frames/styled/00001.png" + std::string(kTemporarySuffix))));
  EXPECT_TRUE(fs::exists(folder / "out/frames/styled/00000.png"));
}

TEST(Workspace, F33_UnusableFoldersAtStart) {
  const TemporaryFolder folder;
  WriteText(folder / "file", "x");
  EXPECT_REGRADE_ERROR(Workspace(folder / "file"), ExitCode::kResources, "file");
  EXPECT_REGRADE_ERROR(Workspace(folder / "file/below"), ExitCode::kResources, "cannot make");
  // Root may write anywhere: the rest is for other users.
  if (::geteuid() == 0) {
    const int code = InChild([&folder] {
      ::chmod(folder.path().c_str(), 0555);
      if (::setuid(65534) != 0) return 99;
      try {
        Workspace workspace(folder / "new");
      } catch (const Error& error) {
        return static_cast<int>(error.code());
      }
      return 0;
    });
    EXPECT_EQ(code, static_cast<int>(ExitCode::kResources));
    ::chmod(folder.path().c_str(), 0755);
  }
}

TEST(Workspace, OtherPeoplesFilesAreNotOverwritten) {
  const TemporaryFolder folder;
  WriteText(folder / "frames/holiday.png", "mine");
  EXPECT_REGRADE_ERROR(Workspace(folder.path()), ExitCode::kInput, "'frames'");
  EXPECT_FALSE(fs::exists(folder / ".regrade"));
}

TEST(Workspace, CheckpointsBelongToTheirInputs) {
  const TemporaryFolder folder;
  Workspace workspace(folder / "out");
  const std::string state("a\0b", 3);
  workspace.SaveCheckpoint("reconstruct", Inputs(1), {state.substr(0, 1), "", state.substr(1)});
  EXPECT_EQ(workspace.LoadCheckpoint("reconstruct", Inputs(1)), state);
  EXPECT_EQ(workspace.LoadCheckpoint("reconstruct", Inputs(2)), std::nullopt);
  EXPECT_EQ(workspace.LoadCheckpoint("stylize", Inputs(1)), std::nullopt);
  const std::string path = workspace.Path(".regrade/checkpoints/reconstruct");
  const std::string blob = ReadText(path);
  for (size_t i = 0; i < blob.size(); ++i) {
    std::string damaged = blob;
    damaged[i] ^= 4;
    WriteText(path, damaged);
    EXPECT_EQ(workspace.LoadCheckpoint("reconstruct", Inputs(1)), std::nullopt) << i;
    WriteText(path, blob.substr(0, i));
    EXPECT_EQ(workspace.LoadCheckpoint("reconstruct", Inputs(1)), std::nullopt) << i;
  }
}

TEST(FolderLock, F38_ASecondRunGetsTheHolder) {
  const TemporaryFolder folder;
  const Workspace workspace(folder / "out");
  EXPECT_REGRADE_ERROR(Workspace(folder / "out"), ExitCode::kFolderInUse,
                       std::to_string(::getpid()), "started 2");
}

// Twenty processes wait for a start signal; each that gets the lock keeps it until all have
// tried.
TEST(FolderLock, F38_OfTwentyAtOnceOneWins) {
  const TemporaryFolder folder;
  for (int round = 0; round < 5; ++round) {
    int gate[2], tried[2], leave[2];
    ASSERT_EQ(::pipe(gate) | ::pipe(tried) | ::pipe(leave), 0);
    std::vector<pid_t> children;
    for (int i = 0; i < 20; ++i) {
      const pid_t child = ::fork();
      if (child == 0) {
        char byte;
        ::close(gate[1]);
        ::close(leave[1]);
        (void)!::read(gate[0], &byte, 1);
        int code = 0;
        try {
          const Workspace workspace(folder / "out");
          (void)!::write(tried[1], "x", 1);
          (void)!::read(leave[0], &byte, 1);
        } catch (const Error& error) {
          code = static_cast<int>(error.code());
          (void)!::write(tried[1], "x", 1);
        }
        ::_exit(code);
      }
      children.push_back(child);
    }
    ::close(gate[0]);
    ::close(leave[0]);
    ::close(gate[1]);  // go
    for (int i = 0; i < 20; ++i) {
      char byte;
      ASSERT_EQ(::read(tried[0], &byte, 1), 1);
    }
    ::close(leave[1]);
    int winners = 0, refused = 0;
    for (const pid_t child : children) {
      int status = 0;
      ::waitpid(child, &status, 0);
      winners += WIFEXITED(status) && WEXITSTATUS(status) == 0;
      refused += WIFEXITED(status) && WEXITSTATUS(status) == 7;
    }
    ::close(tried[0]);
    ::close(tried[1]);
    EXPECT_EQ(winners, 1);
    EXPECT_EQ(refused, 19);
  }
}

// Parts of a film: side by side, but not beside a run, whichever came first.
TEST(FolderLock, F38_PartsShareItAndRunsDoNot) {
  const TemporaryFolder folder;
  EXPECT_REGRADE_ERROR(Workspace(folder / "out", Workspace::BesideOthers()), ExitCode::kInput,
                       "no run has worked");
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
  {
    const Workspace run(folder / "out");
    EXPECT_REGRADE_ERROR(Workspace(folder / "out", Workspace::BesideOthers()),
                         ExitCode::kFolderInUse, "in use by process");
  }
  WriteText(folder / "out/of_a_part.regrade-tmp", "begun");
  {
    const Workspace part(folder / "out", Workspace::BesideOthers());
    EXPECT_NO_THROW(Workspace(folder / "out", Workspace::BesideOthers()));
    EXPECT_REGRADE_ERROR(Workspace(folder / "out"), ExitCode::kFolderInUse,
                         "in use by process");
    EXPECT_TRUE(std::filesystem::exists(folder / "out/of_a_part.regrade-tmp"));
    // Of two, the one that came first goes on.
    EXPECT_EQ(InChild([&folder] {
                const Workspace second(folder / "out", Workspace::BesideOthers());
                return false;
              }),
              0);
  }
  EXPECT_NO_THROW(Workspace(folder / "out"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out/of_a_part.regrade-tmp"));
}

TEST(FolderLock, F38_DeathReleasesIt) {
  const TemporaryFolder folder;
  const int code = InChild([&folder] {
    auto* workspace = new Workspace(folder / "out");  // never destroyed
    ::kill(::getpid(), SIGKILL);
    return workspace == nullptr;
  });
  EXPECT_EQ(code, 128 + SIGKILL);
  EXPECT_NO_THROW(Workspace(folder / "out"));
}

TEST(FolderLock, F39_TheFileOfALostLockIsNamed) {
  const TemporaryFolder folder;
  const std::string lock = folder / "out/.regrade/lock";
  const Workspace workspace(folder / "out");
  const auto hint = [&folder] {
    try {
      const Workspace second(folder / "out");
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kFolderInUse);
      return error.hint();
    }
    ADD_FAILURE() << "the folder is not in use";
    return std::string();
  };
  EXPECT_EQ(hint().find(lock), std::string::npos);  // of a living process
  // Of an unknown one, as on a network drive.
  WriteText(lock, R"({"pid": 1, "host": "elsewhere", "start": "2001-01-01T00:00:00Z"})");
  EXPECT_NE(hint().find("remove " + lock), std::string::npos) << hint();
  std::filesystem::remove(lock);
  EXPECT_NO_THROW(Workspace(folder / "out"));
}

// After a power loss a name must not refer to an incomplete file, and must not be lost.
TEST(AtomicFile, F36_ContentIsOnDiskBeforeItsNameAndThenTheNameIs) {
  const TemporaryFolder folder;
  std::vector<std::string> calls;
  disk_calls = &calls;
  WriteFileAtomically(folder / "a", "text");
  RenameDurably(folder / "a", folder / "b");
  disk_calls = nullptr;
  EXPECT_EQ(calls, (std::vector<std::string>{"sync file", "rename", "sync folder", "rename",
                                             "sync folder"}));
}

TEST(AtomicFile, F28_FailedWritesLeaveTheOldFile) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "a", "old");
  const int code = InChild([&folder] {
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit = {1000, 1000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    try {
      WriteFileAtomically(folder / "a", std::string(5000, 'x'));
    } catch (const Error& error) {
      return error.code() == ExitCode::kResources ? 0 : 1;
    }
    return 2;
  });
  EXPECT_EQ(code, 0);
  EXPECT_EQ(ReadText(folder / "a"), "old");
  EXPECT_FALSE(fs::exists(folder / ("a" + std::string(kTemporarySuffix))));
}

}  // namespace
}  // namespace regrade
