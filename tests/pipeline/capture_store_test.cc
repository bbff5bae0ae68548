// Captures by their content: one of our own output folders is a capture, under the same poses.
#include "pipeline/capture_store.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "kernels/base/child_process.h"
#include "pipeline/files/json_file.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::TemporaryFolder;

int Regrade(std::vector<std::string> arguments) {
  ChildOptions options;
  options.argv = {REGRADE_PROGRAM};
  options.argv.insert(options.argv.end(), arguments.begin(), arguments.end());
  options.wall_limit_s = 120;
  const ChildResult result = RunChild(options, [](const std::string&) {});
  return result.end == ChildEnd::kExited ? result.exit_status : -1;
}

TEST(CaptureStore, AnOutputFolderIsACaptureWithItsPoses) {
  const TemporaryFolder folder;
  ASSERT_EQ(Regrade({"synth", folder / "s", "--views", "6", "--size", "96x72"}), 0);
  ASSERT_EQ(
      Regrade({"pose", folder / "s/truth", "--out", folder / "first", "--tracks", "given"}), 0);
  EXPECT_EQ(DetectCapture(folder / "s/truth").kind, CaptureKind::kTransforms);
  for (const char* name : {"first", "first/poses"}) {
    const CaptureSource source = DetectCapture(folder / name);
    EXPECT_EQ(source.kind, CaptureKind::kPosed) << name;
    EXPECT_EQ(std::filesystem::path(source.photos).filename(), "photos");
  }
  ASSERT_EQ(
      Regrade({"pose", folder / "first", "--out", folder / "second", "--tracks", "given"}), 0);
  const Capture before = ReadCapture(folder / "first/poses"),
                after = ReadCapture(folder / "second/poses");
  ASSERT_EQ(after.views.size(), 6u);
  for (size_t i = 0; i < 6; ++i)
    EXPECT_LE(Norm(before.views[i].camera.Center() - after.views[i].camera.Center()), 1e-12)
        << "a quaternion's rounding";
  // Into itself it would be written over.
  EXPECT_EQ(Regrade({"pose", folder / "first", "--out", folder / "first"}), 2);
  EXPECT_EQ(Regrade({"pose", folder / "first/poses", "--out", folder / "first"}), 2);
  EXPECT_EQ(ReadCapture(folder / "first/poses").views.size(), 6u);
}

// What photos.json alone knows of a capture decides about its field's box: it is an input.
TEST(CaptureStore, ANearestDepthThatChangedIsAnotherCapture) {
  const TemporaryFolder folder;
  ASSERT_EQ(Regrade({"synth", folder / "s", "--views", "6", "--size", "96x72"}), 0);
  ASSERT_EQ(
      Regrade({"pose", folder / "s/truth", "--out", folder / "first", "--tracks", "given"}), 0);
  ASSERT_EQ(
      Regrade({"pose", folder / "first", "--out", folder / "second", "--tracks", "given"}), 0);
  ASSERT_EQ(
      Regrade({"pose", folder / "first", "--out", folder / "second", "--tracks", "given"}), 0);
  const std::string index = folder / "first/poses/photos.json";
  JsonValue json = ReadJsonFile(index);
  json["nearest_depth"] = 0.5;
  WriteJsonFile(index, json);
  EXPECT_EQ(
      Regrade({"pose", folder / "first", "--out", folder / "second", "--tracks", "given"}), 3);
}

// Without tracks there is nothing to refine by: said where it was asked for.
TEST(CaptureStore, PosesWithoutTracksCannotBeRefined) {
  const TemporaryFolder folder;
  ASSERT_EQ(Regrade({"synth", folder / "s", "--views", "6", "--size", "96x72"}), 0);
  EXPECT_EQ(Regrade({"pose", folder / "s/truth", "--out", folder / "out", "--effects",
                     "pose-refinement=on", "--tracks", "given"}),
            6);
}

}  // namespace
}  // namespace regrade
