// The built program from outside: exit codes and messages.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "kernels/process/child_process.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/video_writer.h"
#include "pipeline/program/interrupt.h"
#include "pipeline/workspace/workspace.h"
#include "tests/support/run_program.h"
#include "tests/support/source_dir.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::ProgramOutcome;
using testing::Regrade;
using testing::RunProgram;
using testing::TemporaryFolder;
using testing::WriteText;

TEST(Program, HelpAndVersion) {
  for (const auto& arguments :
       std::vector<std::vector<std::string>>{{}, {"help"}, {"--help"}, {"-h"}}) {
    const ProgramOutcome outcome = Regrade(arguments);
    EXPECT_EQ(outcome.code, 0);
    EXPECT_SAYS(outcome, "reconstruct");
    EXPECT_SAYS(outcome, "tradeoff");
  }
  EXPECT_SAYS(Regrade({"--version"}), "regrade 0.");
  const ProgramOutcome help = Regrade({"run", "--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_SAYS(help, "--film-seconds");
  EXPECT_EQ(help.text.find("--photo-size"), std::string::npos);
  EXPECT_LE(std::ranges::count(help.text, '\n'), 45);
  EXPECT_LE(std::ranges::count(Regrade({}).text, '\n'), 45);
  const ProgramOutcome all = Regrade({"run", "--help-all"});
  EXPECT_SAYS(all, "--photo-size");
  EXPECT_SAYS(all, "default 800");
  EXPECT_SAYS(all, "--no-NAME");
  EXPECT_EQ(all.text.find("fit-rays"), std::string::npos);  // a constant
  EXPECT_SAYS(Regrade({"run", "--help-constants"}), "\n  fit-rays N");
}

// A command's own options are in its short help, and those that it ignores are not.
TEST(Program, HelpShowsTheOptionsOfTheCommand) {
  const ProgramOutcome retouch = Regrade({"retouch", "--help"}),
                       pose = Regrade({"pose", "--help"});
  for (const char* part : {"--photo ", "--edited", "--from", "--vignette"})
    EXPECT_SAYS(retouch, part);
  EXPECT_EQ(retouch.text.find("--masks"), std::string::npos);
  EXPECT_EQ(pose.text.find("--style"), std::string::npos);
  EXPECT_SAYS(Regrade({"evaluate", "--help"}), "--reference");
  EXPECT_SAYS(Regrade({"tradeoff", "--help"}), "--budget");
  EXPECT_SAYS(Regrade({"render", "--help"}), "--photo");
  EXPECT_SAYS(Regrade({"contact-sheet", "--help"}), "--views");
}

// Both are written from the table of options.
TEST(Program, ManPageAndCompletionHaveEveryCommandAndOption) {
  const ProgramOutcome man = Regrade({"manual"}), bash = Regrade({"manual", "bash"});
  EXPECT_EQ(man.code, 0);
  EXPECT_EQ(bash.code, 0);
  for (const char* part : {".TH REGRADE 1", "regrade contact", "photo\\-size", "film\\-seconds",
                           "8 a metric of \\-\\-require"})
    EXPECT_SAYS(man, part);
  for (const char* part : {"    stylize) cat", "--preset smoke draft standard paper best",
                           "complete -o default -F _regrade regrade"})
    EXPECT_SAYS(bash, part);
}

TEST(Program, F18_UsageErrorsExitWith2) {
  ProgramOutcome outcome = Regrade({"recontruct"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_SAYS(outcome, "did you mean `regrade reconstruct`?");
  outcome = Regrade({"pose", "x", "--out", "y", "--treads", "2"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_SAYS(outcome, "--threads");
  EXPECT_EQ(Regrade({"pose", "x", "--out", "y", "--threads", "12abc"}).code, 2);
  EXPECT_EQ(Regrade({"pose", "--out", "y"}).code, 2);
  EXPECT_EQ(Regrade({"pose", "a", "b", "--out", "y"}).code, 2);
  EXPECT_EQ(Regrade({"pose", "a"}).code, 2);
  EXPECT_EQ(Regrade({"tradeoff"}).code, 2);
  EXPECT_EQ(Regrade({"synth", "x", "--scene", "moon"}).code, 2);
}

// The event "plan" of a dry run with --json.
JsonValue PlanIn(const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with("{\"event\":\"plan\"")) return ParseJson(line, "plan");
  ADD_FAILURE() << text;
  return {};
}

// Every stage of every style has its seconds, and the whole is their sum; nothing is written.
TEST(Program, ADryRunListsTheStagesOfEachStyle) {
  const TemporaryFolder folder;
  ASSERT_EQ(Regrade({"synth", folder / "s", "--views", "5", "--size", "64x48"}).code, 0);
  const std::string assets = testing::SourceDir() + "/assets/style_";
  const ProgramOutcome outcome =
      Regrade({"run", folder / "s/images", "--style", assets + "sunset.png", "--style",
               assets + "night.png", "--out", folder / "o", "--max-memory", "0.05", "--dry-run",
               "--json"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  const JsonValue plan = PlanIn(outcome.text);
  const JsonValue::Array& stages = plan.At("stages").AsArray();
  ASSERT_EQ(stages.size(), 2u + 5 + 5);
  double sum = 0;
  for (const JsonValue& stage : stages) sum += stage.At("seconds").AsDouble();
  EXPECT_NEAR(plan.At("seconds").AsDouble(), sum, 1e-9);
  EXPECT_EQ(stages[0].Find("style"), nullptr);
  EXPECT_EQ(stages[2].At("style").AsString(), "style_sunset");
  EXPECT_EQ(stages[11].At("style").AsString(), "style_night");
  EXPECT_EQ(stages[11].At("stage").AsString(), "report");
  // The fit takes more than the limit.
  EXPECT_SAYS(outcome, "{\"event\":\"warning\"");
  EXPECT_FALSE(std::filesystem::exists(folder / "o"));
}

// The number of rays is set for the photos before the fit's time is planned.
TEST(Program, APlanOfANewFolderHasTheTimeOfTheFit) {
  const TemporaryFolder folder;
  ASSERT_EQ(Regrade({"synth", folder / "s", "--views", "5", "--size", "64x48"}).code, 0);
  const ProgramOutcome outcome = Regrade(
      {"reconstruct", folder / "s/images", "--out", folder / "o", "--dry-run", "--json"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  const JsonValue plan = PlanIn(outcome.text);
  ASSERT_EQ(plan.At("stages").AsArray().size(), 2u);
  const JsonValue& fit = plan.At("stages").AsArray()[1];
  EXPECT_EQ(fit.At("stage").AsString(), "reconstruct");
  EXPECT_FALSE(fit.At("done").AsBool());
  EXPECT_GT(fit.At("seconds").AsDouble(), 1);
  EXPECT_GT(fit.At("memory").AsInt(), 100'000'000);
}

TEST(Program, F90_FilmsArePlannedAndDamagedOnesExitWith3) {
  const TemporaryFolder folder;
  VideoWriter film(folder / "walk.mp4", 64, 48, 30);
  for (int i = 0; i < 45; ++i) film.Add(Image(64, 48));
  film.Finish();
  ProgramOutcome outcome =
      Regrade({"pose", folder / "walk.mp4", "--out", folder / "o", "--dry-run"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_SAYS(outcome, "1 film (1.5 s), of which 40 to 120 frames are picked in");
  EXPECT_FALSE(std::filesystem::exists(folder / "o"));
  std::filesystem::resize_file(folder / "walk.mp4", 300);
  std::ofstream(folder / "empty.mov");
  for (const char* name : {"walk.mp4", "empty.mov", "none.mp4"}) {
    outcome = Regrade({"pose", folder / name, "--out", folder / "o"});
    EXPECT_EQ(outcome.code, 3) << outcome.text;
    EXPECT_SAYS(outcome, name);
  }
}

// The child process of crash_probe.h.
TEST(Program, F73_ProbesReadOneFileAndReport) {
  const TemporaryFolder folder;
  WriteText(folder / "diary.onnx", "Dear diary,");
  for (const char* kind : {"style", "pair"}) {
    const ProgramOutcome outcome =
        Regrade({"--probe", "30000000000", kind, folder / "diary.onnx"});
    EXPECT_EQ(outcome.code, 4);
    EXPECT_SAYS(outcome, "diary.onnx");
  }
  EXPECT_EQ(Regrade({"--probe", "30000000000", "novel", "x"}).code, 2);
  EXPECT_EQ(Regrade({"--probe", "style", "x"}).code, 2);
}

TEST(Program, F21_ContradictionsNameBoth) {
  const ProgramOutcome outcome =
      Regrade({"reconstruct", "x", "--out", "y", "--field", "voxels", "--config",
               R"({"fit-resolutions": [32], "fit-steps": [9, 9]})"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_SAYS(outcome, "fit-resolutions");
  EXPECT_SAYS(outcome, "fit-steps");
}

TEST(Program, TheStyleMethodIsCheckedBeforeAnyWork) {
  const TemporaryFolder folder;
  WriteText(folder / "photos/a.png", "x");
  const std::string style = testing::SourceDir() + "/assets/style_sunset.png";
  const auto run = [&](const std::string& method) {
    return Regrade({"run", folder / "photos", "--style", style, "--out", folder / "out",
                    "--method", method});
  };
  for (const char* method : {"wct2", "folder:", "command:restyle {input}"}) {
    const ProgramOutcome outcome = run(method);
    EXPECT_EQ(outcome.code, 2) << method;
    EXPECT_SAYS(outcome, "--method");
  }
  for (const char* method : {"folder:/nowhere/styled", "onnx:/nowhere/styled"}) {
    const ProgramOutcome outcome = run(method);
    EXPECT_EQ(outcome.code, 3) << method;
    EXPECT_SAYS(outcome, "/nowhere/styled");
  }
  // Folders that are there, and hold no networks, or none that can be read.
  WriteText(folder / "letters/a.txt", "x");
  WriteText(folder / "broken/encoder.onnx", "not a network");
  for (const char* networks : {"letters", "broken"}) {
    const ProgramOutcome outcome = run("onnx:" + (folder / networks));
    EXPECT_EQ(outcome.code, 4) << networks;
    EXPECT_SAYS(outcome, folder / networks);
    EXPECT_SAYS(outcome, "encoder.onnx");
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

TEST(Program, F13_MissingFolderExitsWith3) {
  const TemporaryFolder folder;
  const ProgramOutcome outcome = Regrade({"pose", folder / "none", "--out", folder / "out"});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_SAYS(outcome, folder / "none");
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
  std::filesystem::create_directories(folder / "empty");
  EXPECT_EQ(Regrade({"pose", folder / "empty", "--out", folder / "out"}).code, 3);
}

TEST(Program, F16_StyleIsCheckedFirst) {
  const TemporaryFolder folder;
  WriteText(folder / "photos/a.png", "x");
  WriteText(folder / "style.jpg", "not a picture");
  const ProgramOutcome outcome = Regrade(
      {"run", folder / "photos", "--style", folder / "style.jpg", "--out", folder / "out"});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_SAYS(outcome, "style.jpg");
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

TEST(Program, F38_LockedFolderExitsWith7) {
  const TemporaryFolder folder;
  WriteText(folder / "photos/a.png", "x");
  const Workspace workspace(folder / "out");
  const ProgramOutcome outcome = Regrade({"pose", folder / "photos", "--out", folder / "out"});
  EXPECT_EQ(outcome.code, 7);
  EXPECT_SAYS(outcome, std::to_string(::getpid()));
}

// `regrade render` in a folder of a run, under limits that a shell sets.
ProgramOutcome RenderUnder(const std::string& limits,
                           const std::vector<std::string>& arguments) {
  const TemporaryFolder folder;
  { const Workspace workspace(folder / "out"); }
  for (const char* run : {"out/run.json", "out/styles/style_sunset/run.json"})
    WriteText(folder / run, "{\"arguments\": [\"photos\"], \"options\": {\"style\": \"" +
                                testing::SourceDir() + "/assets/style_sunset.png\"}}");
  std::vector<std::string> words{"-c", limits + "; exec \"$0\" \"$@\"", REGRADE_PROGRAM,
                                 "render", folder / "out"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return RunProgram("/bin/sh", words);
}

// Standard streams and the lock take the four files that may be open.
TEST(Program, F25_WithoutAFileLeftToListTheFolderExitsWith5) {
  const ProgramOutcome outcome = RenderUnder("ulimit -n 4", {});
  EXPECT_EQ(outcome.code, 5) << outcome.text;
  EXPECT_SAYS(outcome, "Too many open files");
}

// Stacks of 8 MB: 4096 of them do not fit into 4 GB of address space.
TEST(Program, F44_ThreadsThatCannotStartExitWith5) {
  const ProgramOutcome outcome =
      RenderUnder("ulimit -s 8192; ulimit -v 4000000", {"--threads", "4096"});
  EXPECT_EQ(outcome.code, 5) << outcome.text;
  EXPECT_SAYS(outcome, "cannot start 4096 threads");
}

TEST(Program, F22_ConfigErrorsNameTheLine) {
  const TemporaryFolder folder;
  WriteText(folder / "c.json", "{\"arguments\": [],\n \"options\": {\n  \"sed\": 1}}");
  ProgramOutcome outcome = Regrade({"run", "x", "--config", folder / "c.json"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_SAYS(outcome, "c.json:3:");
  EXPECT_SAYS(outcome, "\"seed\"");
  WriteText(folder / "c.json", "{\n oops");
  outcome = Regrade({"run", "x", "--config", folder / "c.json"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_SAYS(outcome, "c.json:2:");
}

// A style is read by the child that decodes, also before any work.
TEST(Program, AStyleThatCannotBeUsedOrIsSteepIsSaidBeforeAnyWork) {
  const TemporaryFolder folder;
  WriteText(folder / "photos/a.png", "x");
  const auto plan = [&](const std::string& style) {
    return Regrade({"run", folder / "photos", "--style", folder / style, "--out",
                    folder / "out", "--dry-run"});
  };
  WriteText(folder / "steep.cube", "LUT_1D_SIZE 2\n+0 0 0\n+61.7 1 1\n");
  const ProgramOutcome steep = plan("steep.cube");
  EXPECT_EQ(steep.code, 0) << steep.text;
  EXPECT_SAYS(steep, "61.70 times");
  WriteText(folder / "half.png", "\x89PNG\r\n\x1a\n");
  const ProgramOutcome half = plan("half.png");
  EXPECT_EQ(half.code, 3) << half.text;
  EXPECT_SAYS(half, folder / "half.png");
}

TEST(Program, JsonLinesAreJson) {
  const TemporaryFolder folder;
  const ProgramOutcome outcome =
      Regrade({"synth", folder / "s", "--views", "2", "--size", "64x48", "--json"});
  EXPECT_EQ(outcome.code, 0);
  int events = 0;
  size_t begin = 0;
  for (size_t end; (end = outcome.text.find('\n', begin)) != std::string::npos;
       begin = end + 1) {
    const std::string line = outcome.text.substr(begin, end - begin);
    if (line.empty() || line[0] != '{') continue;  // stderr, for people
    EXPECT_TRUE(ParseJson(line, "line").At("event").IsString());
    ++events;
  }
  EXPECT_GE(events, 2);
}

}  // namespace
}  // namespace regrade
