// Captures with poses and without points: what the installed COLMAP finds for them, and that
// nothing is lost where there is none.
#include "pipeline/capture/pose_tracks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/process/child_process.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/scene_profile.h"
#include "pipeline/capture/synth_effects.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "reconstruct/colmap/colmap_model.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::ReadText;
using testing::Said;
using testing::TemporaryFolder;

constexpr int kViews = 12;

void Synth(const std::string& out, const std::string& effects) {
  std::vector<std::string> words = {"synth",  out,      "--views", std::to_string(kViews),
                                    "--size", "280x210"};
  if (!effects.empty()) words.insert(words.end(), {"--effects", effects});
  Said(words);
}

JsonValue PoseMetrics(const std::string& out) {
  return ReadJsonFile(out + "/.regrade/stages/pose.json").At("metrics");
}

TEST(PoseTracks, WithoutColmapResultsAreThoseWithoutTracks) {
  const TemporaryFolder folder;
  Synth(folder / "s", "");
  Said({"pose", folder / "s/truth", "--out", folder / "given", "--tracks", "given"});
  const std::string output =
      Said({"pose", folder / "s/truth", "--out", folder / "none", "--config",
            R"({"colmap": ")" + (folder / "no-such-colmap") + R"("})"});
  EXPECT_NE(output.find("COLMAP found no tracks"), std::string::npos) << output;
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"})
    EXPECT_EQ(ReadText(folder / (std::string("given/poses/sparse/") + name)),
              ReadText(folder / (std::string("none/poses/sparse/") + name)))
        << name;
  EXPECT_EQ(ReadText(folder / "given/poses/photos.json"),
            ReadText(folder / "none/poses/photos.json"));
  EXPECT_EQ(PoseMetrics(folder / "given").Find("tracks"), nullptr);
}

TEST(PoseTracks, NotForTransparentPhotosOrGivenPoints) {
  const TemporaryFolder folder;
  PoseOptions options;
  Capture capture;
  Image alpha(8, 8, 1);  // all transparent
  const std::string photo = folder / "00000.png";
  WritePng8(folder / "00000.alpha.png", alpha);
  CaptureView view{"00000.png", "a.png", photo, {}};
  view.camera.width = view.camera.height = 8;
  capture.views = {view};
  EXPECT_FALSE(WantsTracks(options, "auto", capture));
  EXPECT_TRUE(WantsTracks(options, "alpha=off", capture));
  options.tracks = "given";
  EXPECT_FALSE(WantsTracks(options, "alpha=off", capture));
  options.tracks = "auto";
  capture.points.resize(1);
  EXPECT_FALSE(WantsTracks(options, "alpha=off", capture));
}

// A drift of +-30 %, poses in a transforms.json, no points.
TEST(PoseTracks, ExposureOfGivenPosesIsFoundWithinTwoPerCent) {
  if (!testing::HaveColmap()) GTEST_SKIP() << "no colmap here";
  const TemporaryFolder folder;
  Synth(folder / "s", "exposure");
  Said({"pose", folder / "s/truth", "--out", folder / "out"});
  const Capture capture = ReadCapture(folder / "out/poses");
  ASSERT_EQ(capture.views.size(), static_cast<size_t>(kViews));
  const SceneProfile profile = ProfileScene(capture, 2, "auto");
  ASSERT_FALSE(profile.gains.of_view.empty()) << "exposure is off";
  std::vector<double> ratios;
  double mean = 0;
  for (int i = 0; i < kViews; ++i) {
    const PhotoExposure& photo = profile.exposure.photos[static_cast<size_t>(i)];
    ASSERT_TRUE(photo.known);
    for (int c = 0; c < 3; ++c) {
      ratios.push_back(std::log(photo.gain[c] / SynthGain(0, i, kViews)));
      mean += ratios.back() / (3 * kViews);
    }
  }
  double worst = 0;
  for (const double ratio : ratios) worst = std::max(worst, std::abs(ratio - mean));
  EXPECT_LE(worst, 0.02);
}

// Poses of the right photos in the wrong order: COLMAP finds points for them, by chance.
TEST(PoseTracks, PosesOfOtherPhotosAreRejected) {
  if (!testing::HaveColmap()) GTEST_SKIP() << "no colmap here";
  const TemporaryFolder folder;
  Synth(folder / "s", "");
  const std::string path = folder / "s/truth/transforms.json";
  JsonValue json = ReadJsonFile(path);
  JsonValue::Array frames = json.At("frames").AsArray();
  std::vector<JsonValue> poses;
  for (const JsonValue& frame : frames) poses.push_back(frame.At("transform_matrix"));
  for (size_t i = 0; i < frames.size(); ++i)
    frames[i]["transform_matrix"] = poses[(5 * i + 3) % poses.size()];
  json["frames"] = frames;
  WriteJsonFile(path, json);
  const std::string output = Said({"pose", folder / "s/truth", "--out", folder / "out"});
  EXPECT_NE(output.find("poses of other photos"), std::string::npos) << output;
  EXPECT_TRUE(ReadCapture(folder / "out/poses").points.empty());
}

// Masks by the names of photos, with their extension or without, of half the size: what they
// blacken is not matched.
TEST(PoseTracks, MaskedPixelsAreNotMatched) {
  if (!testing::HaveColmap()) GTEST_SKIP() << "no colmap here";
  const TemporaryFolder folder;
  Synth(folder / "s", "");
  fs::create_directories(folder / "masks");
  Image mask(140, 105, 1);
  for (int y = 0; y < mask.height; ++y)
    for (int x = 70; x < mask.width; ++x) *mask.at(x, y) = 1;
  for (int i = 1; i < kViews; ++i) {  // the first has none
    char name[32];
    std::snprintf(name, sizeof name, i % 2 ? "%05d.png" : "%05d.png.png", i);
    WritePng8(folder / ("masks/" + std::string(name)), mask);
  }
  Said(
      {"pose", folder / "s/truth", "--out", folder / "out", "--photo-masks", folder / "masks"});
  const ColmapModel model = ReadColmapModel(folder / "out/poses/sparse");
  ASSERT_GE(model.points.size(), kFewestTracks);
  int64_t observations = 0, in_first = 0;
  for (const ColmapImage& image : model.images)
    for (const ColmapKeypoint& keypoint : image.keypoints) {
      if (image.name != "00000.png") {
        EXPECT_GE(keypoint.u, 139) << image.name;  // the mask's edge, to a pixel
        ++observations;
      } else if (keypoint.u < 139) {
        ++in_first;
      }
    }
  EXPECT_GT(observations, 500);
  EXPECT_GT(in_first, 20);
  // Other masks are other inputs; and a folder without a mask of a photo is a mistake.
  EXPECT_NE(
      ReadJsonFile(folder / "out/.regrade/stages/pose.json").At("inputs").Find("photo_masks"),
      nullptr);
  EXPECT_FALSE(RunChild({.argv = {REGRADE_PROGRAM, "pose", folder / "s/truth", "--out",
                                  folder / "wrong", "--photo-masks", folder / "s/truth/flow"}})
                   .Succeeded());
}

// Poses 0.3 degrees and 0.5 % of the spread off, handed over without their tracks.
TEST(PoseTracks, PerturbedPosesAreRefined) {
  if (!testing::HaveColmap()) GTEST_SKIP() << "no colmap here";
  const TemporaryFolder folder;
  Synth(folder / "s", "poses");
  Said({"pose", folder / "s", "--out", folder / "off", "--effects", "pose-refinement=off"});
  Said({"export", folder / "off", "--format", "transforms", "--out", folder / "shaken"});
  const std::string output =
      Said({"pose", folder / "shaken", "--out", folder / "out", "--verbose"});
  ASSERT_NE(output.find("pose-refinement on"), std::string::npos) << output;
  Said({"pose", folder / "s/truth", "--out", folder / "truth", "--tracks", "given"});
  const Capture truth = ReadCapture(folder / "truth/poses"),
                before = ReadCapture(folder / "off/poses"),
                after = ReadCapture(folder / "out/poses");
  // How far turns from photo to photo are from the true ones, degrees: free of the gauge.
  const auto error = [&truth](const Capture& capture) {
    double sum = 0;
    for (size_t i = 1; i < truth.views.size(); ++i) {
      const auto turn = [i](const Capture& c) {
        return c.views[i].camera.camera_from_world.rotation *
               c.views[i - 1].camera.camera_from_world.rotation.Transposed();
      };
      const Mat3d off = turn(capture) * turn(truth).Transposed();
      const Vec3d axis{off(2, 1) - off(1, 2), off(0, 2) - off(2, 0), off(1, 0) - off(0, 1)};
      sum += std::asin(std::min(1.0, 0.5 * Norm(axis))) * 180 / M_PI;
    }
    return sum / static_cast<double>(truth.views.size() - 1);
  };
  EXPECT_GT(error(before), 0.3);
  EXPECT_LT(error(after), 0.1 * error(before));
}

}  // namespace
}  // namespace regrade
