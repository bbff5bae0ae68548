// A run's folder that comes from somebody else: what it names is not run, its links are not
// followed, and what was changed in it is found and named.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>

#include "kernels/process/child_process.h"
#include "pipeline/files/folder_identity.h"
#include "pipeline/files/json_file.h"
#include "pipeline/run/resolve_settings.h"
#include "pipeline/run/run_file.h"
#include "pipeline/run/run_settings.h"
#include "pipeline/workspace/style_folders.h"
#include "pipeline/workspace/workspace.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::ReadText;
using testing::TemporaryFolder;
using testing::WriteText;

void WriteRun(const std::string& path, const JsonValue& options) {
  fs::create_directories(fs::path(path).parent_path());
  WriteJsonFile(path,
                JsonValue::Object{
                    {"schema", 2}, {"arguments", JsonValue::Array()}, {"options", options}});
}

struct Resolved {
  RunSettings settings;
  OutsideOptions asked;
};

Resolved Continue(const TemporaryFolder& folder, const std::vector<std::string>& flags,
                  bool accept) {
  Resolved resolved;
  OptionSet options;
  resolved.settings.Bind(&options);
  options.Parse(flags);
  ResolveSettings({.run_json = folder / "e/run.json",
                   .folder = folder / "e",
                   .accept_outside =
                       [&](const OutsideOptions& outside) {
                         resolved.asked = outside;
                         return accept;
                       }},
                  &options);
  return resolved;
}

TEST(ForeignFolder, WhatItNamesOutsideIsAskedFor) {
  const TemporaryFolder folder;
  WriteRun(folder / "e/run.json", JsonValue::Object{{"method", "command:evil {input} {output}"},
                                                    {"flow", "onnx:/x.onnx"},
                                                    {"lpips", "/x.onnx"},
                                                    {"edges", "/x.onnx"},
                                                    {"match", "regions:/x.onnx"},
                                                    {"masks", "/elsewhere"},
                                                    {"style-mask", folder / "e/mask.png"},
                                                    {"residual", "layers:" + (folder / "x")},
                                                    {"style-steps", 7}});
  const Resolved refused = Continue(folder, {}, false);
  EXPECT_EQ(refused.asked.size(), 7u);
  EXPECT_EQ(refused.settings.style_2d.method, "mkl");
  EXPECT_EQ(refused.settings.consistency.flow, ConsistencyOptions().flow);
  EXPECT_EQ(refused.settings.consistency.lpips, "");
  EXPECT_EQ(refused.settings.object.masks, "");
  EXPECT_EQ(refused.settings.residual.residual, "none");
  EXPECT_EQ(refused.settings.object.style_mask, folder / "e/mask.png");  // its own
  EXPECT_EQ(refused.settings.network.steps, 7);
  const Resolved accepted = Continue(folder, {}, true);
  EXPECT_EQ(accepted.settings.style_2d.method, "command:evil {input} {output}");
  // Flags and --config decide for themselves.
  WriteRun(folder / "mine.json", JsonValue::Object{{"lpips", "/mine.onnx"}});
  const Resolved given = Continue(
      folder, {"--method", "command:mine {input} {output}", "--config", folder / "mine.json"},
      false);
  EXPECT_EQ(given.asked.size(), 5u);
  EXPECT_EQ(given.settings.style_2d.method, "command:mine {input} {output}");
  EXPECT_EQ(given.settings.consistency.lpips, "/mine.onnx");
}

TEST(ForeignFolder, ItsRunCannotSayYes) {
  const TemporaryFolder folder;
  WriteRun(folder / "e/run.json", JsonValue::Object{{"method", "mkl"},
                                                    {"edges", "gradient"},
                                                    {"yes", true},
                                                    {"junit", "/x.xml"},
                                                    {"restart-from", "pose"}});
  const Resolved resolved = Continue(folder, {}, false);
  EXPECT_TRUE(resolved.asked.empty());
  EXPECT_EQ(resolved.settings.consistency.edges, "gradient");
  EXPECT_FALSE(resolved.settings.start.yes);
  EXPECT_EQ(resolved.settings.start.junit, "");
  EXPECT_EQ(resolved.settings.start.restart_from, "");
}

TEST(ForeignFolder, ItsStrengthHasTheBoundsOfTheFlag) {
  const TemporaryFolder folder;
  WriteRun(folder / "e/run.json", JsonValue::Object{{"strength", 1e308}});
  EXPECT_REGRADE_ERROR(StrengthOf(folder / "e"), ExitCode::kUsage, folder / "e/run.json");
  WriteRun(folder / "e/run.json", JsonValue::Object{{"strength", 0.25}});
  EXPECT_EQ(StrengthOf(folder / "e"), 0.25);
}

TEST(ForeignFolder, LinksAndPipesAmongItsFilesAreRefusedByName) {
  for (const char* name : {".regrade/log.txt", ".regrade/lock", ".regrade/checkpoints/stylize",
                           ".regrade/stages/pose.json", "poses/photos.json", "frames", "styles",
                           "films/film.mp4", "styles/.pictures/x", "run.json"}) {
    for (const bool pipe : {false, true}) {
      const TemporaryFolder folder;
      { const Workspace workspace(folder / "e"); }
      const std::string path = folder / ("e/" + std::string(name));
      fs::remove_all(path);
      fs::create_directories(fs::path(path).parent_path());
      WriteText(folder / "victim", "as it was");
      if (pipe)
        ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
      else
        fs::create_symlink(folder / "victim", path);
      EXPECT_REGRADE_ERROR(Workspace(folder / "e"), ExitCode::kInput, path);
      EXPECT_EQ(ReadText(folder / "victim"), "as it was");
    }
  }
  // The folder itself may be a link, as to a larger disk.
  const TemporaryFolder folder;
  fs::create_directories(folder / "disk");
  fs::create_directory_symlink(folder / "disk", folder / "out");
  EXPECT_NO_THROW(Workspace(folder / "out"));
}

TEST(ForeignFolder, LinksThatAKilledProgramLeftAreNoObstacle) {
  const TemporaryFolder folder;
  { const Workspace workspace(folder / "e"); }
  const fs::path logs = folder / "e/.regrade/work/pose/logs";
  fs::create_directories(logs / "regrade-aB3xYz");
  fs::create_symlink("colmap.INFO.1", logs / "regrade-aB3xYz/colmap.INFO");
  EXPECT_NO_THROW(Workspace(folder / "e"));
  fs::create_symlink("regrade-aB3xYz", logs / "regrade-cD3xYz");
  EXPECT_REGRADE_ERROR(Workspace(folder / "e"), ExitCode::kInput,
                       (logs / "regrade-cD3xYz").string());
}

TEST(ForeignFolder, AStyleThatIsALinkIsNoStyle) {
  const TemporaryFolder folder;
  WriteRun(folder / "other/styles/x/run.json", JsonValue::Object());
  fs::create_directories(folder / "e/styles");
  fs::create_directory_symlink(folder / "other/styles/x", folder / "e/styles/x");
  fs::create_symlink("y", folder / "e/styles/y");
  EXPECT_TRUE(StyleNames(folder / "e").empty());
  EXPECT_REGRADE_ERROR(StyleFolder(folder / "e", "x"), ExitCode::kInput, "e/styles/x");
  EXPECT_REGRADE_ERROR(StyleFolder(folder / "e", "y"), ExitCode::kInput, "e/styles/y");
}

TEST(ForeignFolder, AChangedResultIsFoundByWhatOnlyReads) {
  const TemporaryFolder folder;
  {
    Workspace workspace(folder / "e");
    WriteText(folder / "e/poses/a", "abc");
    workspace.Record("pose", JsonValue::Object(), {"poses"}, 1, JsonValue::Object());
  }
  EXPECT_NO_THROW(CheckResults(folder / "e", {}));
  WriteText(folder / "e/poses/a", "abd");
  EXPECT_REGRADE_ERROR(CheckResults(folder / "e", {}), ExitCode::kInput, "poses/a");
}

TEST(ForeignFolder, ValuesOfJsonNameTheirFile) {
  const TemporaryFolder folder;
  WriteText(folder / "a.json", "{\n\"a\": 1}");
  const JsonValue value = ReadJsonFile(folder / "a.json");
  EXPECT_REGRADE_ERROR(value.At("b"), ExitCode::kInput, (folder / "a.json") + ", line");
  EXPECT_REGRADE_ERROR(value.At("a").AsString(), ExitCode::kInput,
                       (folder / "a.json") + ", line 2");
}

TEST(FolderIdentity, EndsWhereTheFolderIsMovedOrAnother) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "e");
  const FolderIdentity identity(folder / "e");
  EXPECT_TRUE(identity.Holds());
  fs::rename(folder / "e", folder / "moved");
  EXPECT_FALSE(identity.Holds());
  fs::create_directories(folder / "e");
  EXPECT_FALSE(identity.Holds());
  fs::remove(folder / "e");
  fs::rename(folder / "moved", folder / "e");
  EXPECT_TRUE(identity.Holds());
}

TEST(ChildProcess, HasATemporaryFolderOfItsOwnThatIsGoneAfterwards) {
  const TemporaryFolder folder;
  std::string own;
  for (const char* end : {"exit 0", "exit 1", "kill -9 $$"}) {
    ChildOptions options;
    options.argv = {"/bin/sh", "-c",
                    "touch $TMPDIR/x; stat -c '%a %n' $TMPDIR; " + std::string(end)};
    options.temporary_parent = folder.path();
    RunChild(options, [&own](const std::string& line) { own = line; });
    EXPECT_TRUE(own.starts_with("700 " + folder.path() + "/")) << own;
    EXPECT_TRUE(fs::is_empty(folder.path())) << end;
  }
}

}  // namespace
}  // namespace regrade
