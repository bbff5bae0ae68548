// Captures by their content: one of our own output folders is a capture, under the same poses.
#include "pipeline/capture/capture_store.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "kernels/image/resize.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

using testing::ExitCodeOf;
using testing::PoseCode;
using testing::TemporaryFolder;

TEST(CaptureStore, AnOutputFolderIsACaptureWithItsPoses) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 6, "96x72");
  ASSERT_EQ(PoseCode(folder / "s/truth", folder / "first"), 0);
  EXPECT_EQ(DetectCapture(folder / "s/truth").kind, CaptureKind::kTransforms);
  for (const char* name : {"first", "first/poses"}) {
    const CaptureSource source = DetectCapture(folder / name);
    EXPECT_EQ(source.kind, CaptureKind::kPosed) << name;
    EXPECT_EQ(std::filesystem::path(source.photos).filename(), "photos");
  }
  ASSERT_EQ(PoseCode(folder / "first", folder / "second"), 0);
  const Capture before = ReadCapture(folder / "first/poses"),
                after = ReadCapture(folder / "second/poses");
  ASSERT_EQ(after.views.size(), 6u);
  for (size_t i = 0; i < 6; ++i)
    EXPECT_LE(Norm(before.views[i].camera.Center() - after.views[i].camera.Center()), 1e-12)
        << "a quaternion's rounding";
  // Into itself it would be written over.
  EXPECT_EQ(ExitCodeOf({"pose", folder / "first", "--out", folder / "first"}), 2);
  EXPECT_EQ(ExitCodeOf({"pose", folder / "first/poses", "--out", folder / "first"}), 2);
  EXPECT_EQ(ReadCapture(folder / "first/poses").views.size(), 6u);
}

// What photos.json alone knows of a capture decides about its field's box: it is an input.
TEST(CaptureStore, ANearestDepthThatChangedIsAnotherCapture) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 6, "96x72");
  ASSERT_EQ(PoseCode(folder / "s/truth", folder / "first"), 0);
  ASSERT_EQ(PoseCode(folder / "first", folder / "second"), 0);
  ASSERT_EQ(PoseCode(folder / "first", folder / "second"), 0);
  const std::string index = folder / "first/poses/photos.json";
  JsonValue json = ReadJsonFile(index);
  json["nearest_depth"] = 0.5;
  WriteJsonFile(index, json);
  EXPECT_EQ(PoseCode(folder / "first", folder / "second"), 3);
}

TEST(CaptureStore, AFolderOfAnotherSchemaIsRefused) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 6, "96x72");
  ASSERT_EQ(PoseCode(folder / "s/truth", folder / "first"), 0);
  const std::string index = folder / "first/poses/photos.json";
  JsonValue json = ReadJsonFile(index);
  json["schema"] = 1;
  WriteJsonFile(index, json);
  EXPECT_REGRADE_ERROR(ReadCapture(folder / "first/poses"), ExitCode::kInput,
                       "is of schema 1, this version of regrade reads schema 2");
  EXPECT_REGRADE_ERROR(ReadCapture(folder / "first/poses"), ExitCode::kInput,
                       "--restart-from pose");
  EXPECT_EQ(ExitCodeOf({"pose", folder / "first", "--out", folder / "second"}), 3);
}

TEST(PhotoStatuses, LaterOnesDecide) {
  const std::vector<PhotoStatus> merged =
      MergeStatuses({{"a", PhotoState::kUsed, "grey"},
                     {"b", PhotoState::kSkipped, "damaged"},
                     {"c", PhotoState::kUsed, ""}},
                    {{"a", PhotoState::kUsed, ""},
                     {"c", PhotoState::kUnregistered, "blurred"},
                     {"d", PhotoState::kSkipped, "not there"}});
  ASSERT_EQ(merged.size(), 4u);
  EXPECT_EQ(merged[0].why, "grey");
  EXPECT_EQ(merged[1].status, PhotoState::kSkipped);
  EXPECT_EQ(merged[2].status, PhotoState::kUnregistered);
  EXPECT_EQ(merged[2].why, "blurred");
  EXPECT_EQ(merged[3].file, "d");
  for (const PhotoStatus& photo : merged)
    EXPECT_EQ(PhotoStateOf(ToString(photo.status)), photo.status);
  EXPECT_FALSE(PhotoStateOf("placed"));
}

// Refinement needs tracks: an error where it was requested.
TEST(CaptureStore, PosesWithoutTracksCannotBeRefined) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 6, "96x72");
  EXPECT_EQ(ExitCodeOf({"pose", folder / "s/truth", "--out", folder / "out", "--effects",
                        "pose-refinement=on", "--tracks", "given"}),
            6);
}

// Of a COLMAP workspace in which pictures are missing the others are staged under names that
// the missing ones have in the model: no photo may get another's pose.
TEST(CaptureStore, F61_PosesOfMissingPicturesAreUnused) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 6, "96x72");
  ASSERT_EQ(PoseCode(folder / "s/truth", folder / "all"), 0);
  ASSERT_EQ(ExitCodeOf({"export", folder / "all", "--out", folder / "w"}), 0);
  for (const char* name : {"00000.png", "00003.png"})
    std::filesystem::remove(folder / (std::string("w/images/") + name));
  ASSERT_EQ(PoseCode(folder / "w", folder / "some"), 0);
  const Capture all = ReadCapture(folder / "all/poses"),
                some = ReadCapture(folder / "some/poses");
  ASSERT_EQ(some.views.size(), 4u);
  const size_t number[] = {1, 2, 4, 5};
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(some.views[i].file, all.views[number[i]].name);
    EXPECT_LE(Norm(some.views[i].camera.Center() - all.views[number[i]].camera.Center()), 1e-12)
        << "a quaternion's rounding";
  }
  ASSERT_EQ(some.statuses.size(), 6u);
  EXPECT_EQ(some.statuses[4].file, "00000.png");
  EXPECT_EQ(some.statuses[4].status, PhotoState::kSkipped);
  // And so as a capture of its own.
  EXPECT_EQ(PoseCode(folder / "some", folder / "again"), 0);
  EXPECT_EQ(ReadCapture(folder / "again/poses").views.size(), 4u);
}

// Pictures that were made smaller after their poses were found, in a folder of another name.
TEST(CaptureStore, H137_CamerasFollowPicturesThatWereResampled) {
  const TemporaryFolder folder;
  ASSERT_EQ(ExitCodeOf({"synth", folder / "s", "--views", "6", "--size", "200x150", "--effects",
                        "poses"}),
            0);
  std::filesystem::rename(folder / "s/images", folder / "s/images_4");
  std::filesystem::create_directories(folder / "s/images_8");  // not this one
  for (int i = 0; i < 6; i += 2) {
    const std::string path = folder / ("s/images_4/0000" + std::to_string(i) + ".png");
    WritePng8(path, Resize(ReadImage(path), 133, 100));
  }
  EXPECT_EQ(DetectCapture(folder / "s").kind, CaptureKind::kColmap);
  ASSERT_EQ(ExitCodeOf({"pose", folder / "s", "--out", folder / "out", "--effects",
                        "pose-refinement=off"}),
            0);
  const Capture capture = ReadCapture(folder / "out/poses");
  ASSERT_EQ(capture.views.size(), 6u);
  EXPECT_EQ(capture.views[0].camera.width, 133);
  EXPECT_NEAR(capture.views[0].camera.fy, capture.views[1].camera.fy / 1.5, 1e-9);
  EXPECT_EQ(capture.views[1].camera.width, 200);
  EXPECT_GT(capture.points.size(), 100u);
  EXPECT_LT(capture.reprojection_px, 3);  // observations moved along
  // Another shape is no size.
  for (int i = 0; i < 6; ++i) {
    const std::string path = folder / ("s/images_4/0000" + std::to_string(i) + ".png");
    WritePng8(path, Resize(ReadImage(path), 200, 180));
  }
  EXPECT_EQ(ExitCodeOf({"pose", folder / "s", "--out", folder / "other"}), 3);
}

// LLFF's file beside pictures of one size only, or among them.
TEST(CaptureStore, PicturesOfAnLlffFile) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "a/images_2");
  std::filesystem::create_directories(folder / "b");
  for (const char* name : {"a", "b"})
    std::ofstream(folder / (std::string(name) + "/poses_bounds.npy")) << "poses";
  EXPECT_EQ(DetectCapture(folder / "a").kind, CaptureKind::kLlff);
  EXPECT_EQ(std::filesystem::path(DetectCapture(folder / "a").photos).filename(), "images_2");
  EXPECT_EQ(DetectCapture(folder / "b").kind, CaptureKind::kLlff);
  EXPECT_EQ(std::filesystem::path(DetectCapture(folder / "b").photos).filename(), "b");
}

// A list of poses that names pictures which are not there.
TEST(CaptureStore, MissingPicturesOfATransformsFileAreReported) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 6, "96x72");
  std::filesystem::remove(folder / "s/images/00002.png");
  ASSERT_EQ(PoseCode(folder / "s/truth", folder / "out"), 0);
  const Capture capture = ReadCapture(folder / "out/poses");
  EXPECT_EQ(capture.views.size(), 5u);
  ASSERT_EQ(capture.statuses.size(), 6u);
  EXPECT_EQ(capture.statuses[5].file, "../images/00002.png");
  EXPECT_EQ(capture.statuses[5].status, PhotoState::kSkipped);
}

}  // namespace
}  // namespace regrade
