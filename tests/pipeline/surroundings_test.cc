// The built program in odd surroundings: no home, no folder for temporary files, a clock that
// jumps, a working folder that is gone, no GPU.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "kernels/device/device_memory.h"
#include "pipeline/program/device_choice.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::PoseCode;
using testing::ProgramOutcome;
using testing::ReadText;
using testing::RunProgram;
using testing::TemporaryFolder;

// A program, started by another one that changes its surroundings.
ProgramOutcome RunIn(const std::vector<std::string>& words) {
  return RunProgram(words[0], {words.begin() + 1, words.end()});
}

std::string Synthetic(const TemporaryFolder& folder) {
  const std::string capture = folder / "capture";
  testing::WriteCapture(capture, 5, "96x72");
  return capture + "/truth";  // the photos with their poses
}

TEST(Surroundings, F23_WithoutHomeAndTemporaryFolder) {
  const TemporaryFolder folder;
  const std::string capture = Synthetic(folder);
  const ProgramOutcome outcome =
      RunIn({"/usr/bin/env", "-i", "TMPDIR=/nowhere", REGRADE_PROGRAM, "pose", capture, "--out",
             folder / "out", "--tracks", "given"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_TRUE(fs::exists(folder / "out/poses/photos.json"));
}

TEST(Surroundings, F26_AClockThatJumpsChangesNothing) {
  const TemporaryFolder folder;
  const std::string capture = Synthetic(folder);
  EXPECT_EQ(PoseCode(capture, folder / "plain"), 0);
  const std::string clock = std::string("LD_PRELOAD=") + ODD_CLOCK;
  for (const char* when : {"fresh", "again"}) {
    const ProgramOutcome outcome =
        RunIn({"/usr/bin/env", clock, REGRADE_PROGRAM, "pose", capture, "--out", folder / "odd",
               "--json", "--tracks", "given"});
    EXPECT_EQ(outcome.code, 0) << outcome.text;
    // What is done is known by its content, not by its date; and no duration is of that clock.
    EXPECT_EQ(outcome.text.find("done before") != std::string::npos, when[0] == 'a')
        << outcome.text;
    const std::string key = "\"seconds\":";
    int durations = 0;
    for (size_t at = outcome.text.find(key); at != std::string::npos;
         at = outcome.text.find(key, at + 1), ++durations) {
      const double seconds = std::stod(outcome.text.substr(at + key.size()));
      EXPECT_TRUE(seconds >= 0 && seconds < 1000) << outcome.text;
    }
    EXPECT_EQ(durations > 0, when[0] == 'f') << outcome.text;
  }
  EXPECT_EQ(ReadText(folder / "odd/poses/photos.json"),
            ReadText(folder / "plain/poses/photos.json"));
  EXPECT_EQ(ReadText(folder / "odd/poses/sparse/images.bin"),
            ReadText(folder / "plain/poses/sparse/images.bin"));
}

TEST(Surroundings, F27_TheCurrentFolderWasDeleted) {
  const TemporaryFolder folder;
  const std::string capture = Synthetic(folder), gone = folder / "gone";
  const std::string leave = "mkdir \"$1\" && cd \"$1\" && rmdir \"$1\" && shift && exec \"$@\"";
  const auto run_gone = [&](const std::string& out) {
    return RunIn({"/bin/sh", "-c", leave, "sh", gone, REGRADE_PROGRAM, "pose", capture, "--out",
                  out, "--tracks", "given"});
  };
  const ProgramOutcome relative = run_gone("out");
  EXPECT_EQ(relative.code, 5) << relative.text;
  EXPECT_SAYS(relative, "the current folder does not exist");
  EXPECT_EQ(run_gone(folder / "out").code, 0);
}

TEST(Surroundings, F27_RelativePathsAndBlanks) {
  const TemporaryFolder folder;
  Synthetic(folder);
  fs::rename(folder / "capture", folder / "a capture");
  const std::string go = "cd \"$1\" && shift && exec \"$@\"";
  const ProgramOutcome outcome =
      RunIn({"/bin/sh", "-c", go, "sh", folder.path(), REGRADE_PROGRAM, "pose",
             "./a capture/truth", "--out", "an out/../an out", "--tracks", "given"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_TRUE(fs::exists(folder / "an out/poses/photos.json"));
}

TEST(Surroundings, ACardByItsNumber) {
  const char* const before = std::getenv("CUDA_VISIBLE_DEVICES");
  const std::string kept = before != nullptr ? before : "";
  const auto shown = [] { return std::string(std::getenv("CUDA_VISIBLE_DEVICES")); };
  unsetenv("CUDA_VISIBLE_DEVICES");
  EXPECT_EQ(ShowOneCard("auto"), "auto");
  EXPECT_EQ(std::getenv("CUDA_VISIBLE_DEVICES"), nullptr);
  EXPECT_EQ(ShowOneCard("cuda:1"), "cuda");
  EXPECT_EQ(shown(), "1");
  setenv("CUDA_VISIBLE_DEVICES", "4,GPU-ab,6", 1);  // what a cluster's engine gave the job
  for (const char* device : {"cuda:", "cuda:x", "cuda:-1", "cuda:1x", "cuda:99999999999"})
    EXPECT_REGRADE_ERROR(ShowOneCard(device), ExitCode::kUsage, "--device");
  EXPECT_REGRADE_ERROR(ShowOneCard("cuda:3"), ExitCode::kResources, "--device cuda:3");
  EXPECT_EQ(shown(), "4,GPU-ab,6");
  EXPECT_EQ(ShowOneCard("cuda:1"), "cuda");
  EXPECT_EQ(shown(), "GPU-ab");
  if (before != nullptr)
    setenv("CUDA_VISIBLE_DEVICES", kept.c_str(), 1);
  else
    unsetenv("CUDA_VISIBLE_DEVICES");
}

TEST(Surroundings, F77_NoGpu) {
  EXPECT_EQ(ChooseBackend("auto", true), Backend::kCpu);
  EXPECT_EQ(ChooseBackend("cpu", false), Backend::kCpu);
  if (ReadDeviceStatus().found) GTEST_SKIP() << "there is one";
  EXPECT_EQ(ChooseBackend("auto", false), Backend::kCpu);
  for (const bool reproducible : {false, true})
    EXPECT_REGRADE_ERROR(ChooseBackend("cuda", reproducible), ExitCode::kResources, "--device");
}

}  // namespace
}  // namespace regrade
