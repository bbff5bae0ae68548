// Captures in the layouts of NSVF, DTU and Blender with a file of test photos, through the
// program: cameras, the split and the box.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/files/json_file.h"
#include "pipeline/files/npz_file.h"
#include "pipeline/images/image_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::ExitCodeOf;
using testing::PoseCode;
using testing::TemporaryFolder;
using testing::WriteText;

constexpr int kPhotos = 8;

class CaptureLayouts : public ::testing::Test {
 protected:
  void SetUp() override {
    testing::WriteCapture(folder_ / "s", kPhotos, "96x72");
    const std::string truth = folder_ / "s/truth/transforms.json";
    for (const TransformsFrame& frame : ReadTransformsJson(truth).frames) {
      cameras_.push_back(frame.camera);
      pictures_.push_back(folder_ / ("s/truth/" + frame.file));
    }
    ASSERT_EQ(cameras_.size(), static_cast<size_t>(kPhotos));
  }

  void CopyPicture(int i, const std::string& to) const {
    fs::create_directories(fs::path(folder_ / to).parent_path());
    fs::copy_file(pictures_[static_cast<size_t>(i)], folder_ / to);
  }

  // The poses of `capture` as regrade stores them.
  Capture Pose(const std::string& capture, const std::string& out) const {
    EXPECT_EQ(PoseCode(folder_ / capture, folder_ / out), 0);
    return ReadCapture(folder_ / (out + "/poses"));
  }

  TemporaryFolder folder_;
  std::vector<Camera> cameras_;  // by photo
  std::vector<std::string> pictures_;
};

std::string PoseText(const Camera& camera) {
  const RigidTransform world = camera.camera_from_world.Inverse();
  std::string text;
  for (int i = 0; i < 3; ++i)
    text += Format("%.17g %.17g %.17g %.17g\n", world.rotation(i, 0), world.rotation(i, 1),
                   world.rotation(i, 2), world.translation[i]);
  return text;
}

std::vector<std::string> FilesOf(const Capture& capture, const std::vector<int>& views) {
  std::vector<std::string> files;
  for (const int i : views) files.push_back(capture.views[static_cast<size_t>(i)].file);
  return files;
}

std::vector<int> HeldOut(const Capture& capture, int holdout) {
  std::vector<int> views;
  const std::vector<bool> held_out = HeldOutViews(capture, holdout);
  for (size_t i = 0; i < held_out.size(); ++i)
    if (held_out[i]) views.push_back(static_cast<int>(i));
  return views;
}

TEST_F(CaptureLayouts, NsvfsPrefixesAndBox) {
  const Camera& first = cameras_[0];
  WriteText(folder_ / "n/intrinsics.txt",
            Format("%.17g 0 %.17g 0\n0 %.17g %.17g 0\n0 0 1 0\n0 0 0 1\n", first.fx, first.cx,
                   first.fy, first.cy));
  WriteText(folder_ / "n/bbox.txt", "-1 -1 -1 1 1 1 0.1\n");
  // 0 to 4 for training, 5 for validation, 6 and 7 for tests.
  for (int i = 0; i < kPhotos; ++i) {
    const std::string name = std::to_string(i < 5    ? 0
                                            : i == 5 ? 1
                                                     : 2) +
                             "_0000" + std::to_string(i);
    CopyPicture(i, "n/rgb/" + name + ".png");
    WriteText(folder_ / ("n/pose/" + name + ".txt"),
              PoseText(cameras_[static_cast<size_t>(i)]));
  }
  WriteText(folder_ / "n/pose/0_00099.txt", PoseText(first));  // its picture is missing
  const CaptureSource source = DetectCapture(folder_ / "n");
  EXPECT_EQ(source.kind, CaptureKind::kNsvf);
  const Capture capture = Pose("n", "out");
  ASSERT_EQ(capture.views.size(), 7u);  // without that for validation
  for (const CaptureView& view : capture.views) {
    const Camera& truth = cameras_[static_cast<size_t>(view.file[6] - '0')];
    EXPECT_NEAR(Norm(view.camera.Center() - truth.Center()), 0, 1e-9) << view.file;
    EXPECT_NEAR(view.camera.fx, truth.fx, 1e-9);
  }
  const std::vector<std::string> test{"2_00006.png", "2_00007.png"};
  EXPECT_EQ(FilesOf(capture, HeldOut(capture, 8)), test);
  EXPECT_EQ(FilesOf(capture, HeldOut(capture, 3)), test);
  EXPECT_TRUE(HeldOut(capture, 0).empty());
  ASSERT_TRUE(capture.box.has_value());
  EXPECT_EQ(Norm(capture.box->low - Vec3d{-1, -1, -1}), 0);
  EXPECT_TRUE(std::ranges::any_of(capture.statuses, [](const PhotoStatus& photo) {
    return photo.file == "0_00099" && photo.why.find("missing") != std::string::npos;
  }));
  // The poses of that folder keep its split and its box.
  const Capture again = Pose("out", "again");
  EXPECT_EQ(HeldOut(again, 8), HeldOut(capture, 8));
  ASSERT_TRUE(again.box.has_value());
}

TEST_F(CaptureLayouts, NsvfWithoutPrefixesHasNoSplit) {
  WriteText(folder_ / "n/intrinsics.txt",
            Format("%.17g %.17g %.17g 0.\n0. 0. 0.\n1.\n", cameras_[0].fx, cameras_[0].cx,
                   cameras_[0].cy));
  for (int i = 0; i < kPhotos; ++i) {
    CopyPicture(i, "n/images/a" + std::to_string(i) + ".png");
    if (i != 2)  // a photo without a pose
      WriteText(folder_ / ("n/poses/a" + std::to_string(i) + ".txt"),
                PoseText(cameras_[static_cast<size_t>(i)]));
  }
  const Capture capture = Pose("n", "out");
  EXPECT_EQ(capture.views.size(), 7u);
  EXPECT_FALSE(HasTestSplit(capture));
  EXPECT_EQ(HeldOut(capture, 4), (std::vector<int>{0, 4}));
  EXPECT_FALSE(capture.box.has_value());
  // A pose that is damaged is refused.
  WriteText(folder_ / "n/poses/a0.txt", "1 0 0 0\n0 1 0 0\n");
  EXPECT_EQ(PoseCode(folder_ / "n", folder_ / "other"), 3);
}

TEST_F(CaptureLayouts, DtusNumberedCameras) {
  NpzWriter writer;
  std::vector<std::vector<double>> matrices;
  for (const Camera& camera : cameras_) {
    const double k[3][3] = {{camera.fx, 0, camera.cx}, {0, camera.fy, camera.cy}, {0, 0, 1}};
    matrices.emplace_back(16, 0.0);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 4; ++j)
        for (int a = 0; a < 3; ++a)
          matrices.back()[static_cast<size_t>(4 * i + j)] +=
              k[i][a] * (j < 3 ? camera.camera_from_world.rotation(a, j)
                               : camera.camera_from_world.translation[a]);
    matrices.back()[15] = 1;
  }
  for (int i = 0; i < kPhotos; ++i) {
    writer.Add("world_mat_" + std::to_string(i), {4, 4},
               matrices[static_cast<size_t>(i)].data());
    if (i != 3) CopyPicture(i, "d/image/00000" + std::to_string(i) + ".png");
  }
  writer.WriteTo(folder_ / "d/cameras.npz");
  EXPECT_EQ(DetectCapture(folder_ / "d").kind, CaptureKind::kDtu);
  const Capture capture = Pose("d", "out");
  ASSERT_EQ(capture.views.size(), 7u);
  for (const CaptureView& view : capture.views) {
    const Camera& truth = cameras_[static_cast<size_t>(view.file[5] - '0')];
    EXPECT_NEAR(Norm(view.camera.Center() - truth.Center()), 0, 1e-9) << view.file;
    EXPECT_NEAR(view.camera.cy, truth.cy, 1e-9);
  }
  EXPECT_TRUE(std::ranges::any_of(
      capture.statuses, [](const PhotoStatus& photo) { return photo.file == "picture 3"; }));
}

TEST_F(CaptureLayouts, BlendersTestPhotosAreHeldOut) {
  std::vector<TransformsFrame> train, test;
  for (int i = 0; i < kPhotos; ++i) {
    const std::string file =
        std::string(i < 5 ? "train/r_" : "test/r_") + std::to_string(i) + ".png";
    CopyPicture(i, "b/" + file);
    (i < 5 ? train : test).push_back({file, cameras_[static_cast<size_t>(i)]});
  }
  CopyPicture(1, "b/val/r_1.png");  // a depth map or a photo for validation: not taken
  WriteTransformsJson(folder_ / "b/transforms_train.json", train);
  const CaptureSource without = DetectCapture(folder_ / "b");
  EXPECT_TRUE(without.test.empty());
  WriteTransformsJson(folder_ / "b/transforms_test.json", test);
  const Capture capture = Pose("b", "out");
  ASSERT_EQ(capture.views.size(), 8u);
  EXPECT_EQ(capture.statuses.size(), 8u);
  EXPECT_EQ(FilesOf(capture, HeldOut(capture, 8)),
            (std::vector<std::string>{"test/r_5.png", "test/r_6.png", "test/r_7.png"}));
  for (const CaptureView& view : capture.views)
    EXPECT_NEAR(
        Norm(view.camera.Center() -
             cameras_[static_cast<size_t>(view.file[view.file.size() - 5] - '0')].Center()),
        0, 1e-9);
  // Test photos that are not there split nothing; a photo cannot be both.
  fs::remove_all(folder_ / "b/test");
  EXPECT_TRUE(DetectCapture(folder_ / "b").test.empty());
  WriteTransformsJson(folder_ / "b/transforms_test.json", {train[0]});
  EXPECT_REGRADE_ERROR(DetectCapture(folder_ / "b"), ExitCode::kInput,
                       "for training and for tests");
}

TEST_F(CaptureLayouts, NerfstudiosMasksAndTestPhotos) {
  std::vector<TransformsFrame> frames;
  for (int i = 0; i < kPhotos; ++i) {
    const std::string name = std::to_string(i) + ".png";
    CopyPicture(i, "f/images/" + name);
    frames.push_back({"images/" + name, cameras_[static_cast<size_t>(i)]});
  }
  const std::string file = folder_ / "f/transforms.json";
  WriteTransformsJson(file, frames);
  Image mask(96, 72, 1);
  std::fill_n(mask.pixels.begin(), 96 * 10, 1.0f);
  fs::create_directories(folder_ / "f/masks");
  WritePng8(folder_ / "f/masks/m5.png", mask);
  JsonValue json = ReadJsonFile(file);
  JsonValue::Array list = json.At("frames").AsArray();
  list[5]["mask_path"] = "masks/m5.png";
  json["frames"] = std::move(list);
  json["test_filenames"] = JsonValue::Array{"images/2.png", "images/7.png"};
  WriteJsonFile(file, json);
  const Capture capture = Pose("f", "out");
  ASSERT_EQ(capture.views.size(), 8u);
  EXPECT_EQ(FilesOf(capture, HeldOut(capture, 8)),
            (std::vector<std::string>{"2.png", "7.png"}));
  EXPECT_EQ(ReadImage(folder_ / "out/poses/masks/00005.png.png").pixels, mask.pixels);
  EXPECT_FALSE(fs::exists(folder_ / "out/poses/masks/00004.png.png"));
  // Another mask is another input.
  EXPECT_EQ(PoseCode(folder_ / "f", folder_ / "out"), 0);
  mask.pixels[96 * 20] = 1;
  WritePng8(folder_ / "f/masks/m5.png", mask);
  EXPECT_EQ(PoseCode(folder_ / "f", folder_ / "out"), 3);
}

TEST_F(CaptureLayouts, PolycamsCameras) {
  for (int i = 0; i < kPhotos; ++i) {
    const Camera& camera = cameras_[static_cast<size_t>(i)];
    const RigidTransform world = camera.camera_from_world.Inverse();
    JsonValue json = JsonValue::Object{{"fx", camera.fx},       {"fy", camera.fy},
                                       {"cx", camera.cx},       {"cy", camera.cy},
                                       {"width", camera.width}, {"height", camera.height},
                                       {"blur_score", 120.0}};
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b)
        json[Concat("t_", a, b)] = (b == 0 ? 1 : -1) * world.rotation(a, b);
      json[Concat("t_", a, 3)] = world.translation[a];
    }
    const std::string name = "17000" + std::to_string(i);
    CopyPicture(i, "p/keyframes/corrected_images/" + name + ".png");
    WriteText(folder_ / ("p/keyframes/corrected_cameras/" + name + ".json"), DumpJson(json));
    WriteText(folder_ / ("p/keyframes/depth/" + name + ".png"), "no photo");
  }
  const Capture capture = Pose("p", "out");
  ASSERT_EQ(capture.views.size(), 8u);
  EXPECT_EQ(capture.statuses.size(), 8u);
  for (int i = 0; i < kPhotos; ++i) {
    const Camera &found = capture.views[static_cast<size_t>(i)].camera,
                 &truth = cameras_[static_cast<size_t>(i)];
    EXPECT_NEAR(Norm(found.Center() - truth.Center()), 0, 1e-9);
    EXPECT_NEAR(Norm(found.Forward() - truth.Forward()), 0, 1e-9);
    EXPECT_NEAR(found.fy, truth.fy, 1e-9);
  }
  WriteText(folder_ / "p/keyframes/corrected_cameras/170000.json", "{\"fx\": 1}");
  EXPECT_EQ(PoseCode(folder_ / "p", folder_ / "other"), 3);
}

// The output folder may be inside the folder of photos: the same command goes on.
TEST_F(CaptureLayouts, ResultsInsideThePhotosAreNoPhotos) {
  const std::vector<std::string> pose{
      "pose", folder_ / "all", "--out", folder_ / "all/images/out", "--tracks", "given"};
  ASSERT_EQ(PoseCode(folder_ / "s/truth", folder_ / "first"), 0);
  ASSERT_EQ(ExitCodeOf({"export", folder_ / "first", "--out", folder_ / "all"}), 0);
  for (int i = 0; i < 2; ++i) {
    ASSERT_EQ(ExitCodeOf(pose), 0) << i;
    EXPECT_EQ(ReadCapture(folder_ / "all/images/out/poses").statuses.size(), 8u) << i;
  }
  // But it is not the folder of photos itself.
  EXPECT_EQ(ExitCodeOf({"pose", folder_ / "all", "--out", folder_ / "all/."}), 2);
  EXPECT_FALSE(fs::exists(folder_ / "all/.regrade"));
}

}  // namespace
}  // namespace regrade
