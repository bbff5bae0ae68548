// Captures whose photos differ in size, orientation and lens, from photos to film and report.
#include <fcntl.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <iterator>

#include "pipeline/capture/transforms_json.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/images/video_reader.h"
#include "tests/support/evaluated_frames.h"
#include "tests/support/source_dir.h"
#include "tests/support/spawn.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::ProgramOutcome;
using testing::Regrade;
using testing::TemporaryFolder;

const std::string kStyle = testing::SourceDir() + "/assets/style_sunset.png";

std::vector<std::string> RunOf(const std::string& capture, const std::string& out,
                               const std::vector<std::string>& more = {}) {
  return testing::Joined(
      testing::Joined({"run", capture, "--style", kStyle, "--out", out, "--reproducible"},
                      testing::TinyFlags()),
      more);
}

std::string SizeOf(const std::string& path) {
  const Image image = ReadImage(path);
  return std::to_string(image.width) + "x" + std::to_string(image.height);
}

// A number that is not finite is null, and its reason stands beside it.
void ExpectFiniteOrReason(const JsonValue& value, const std::string& name) {
  if (value.IsArray())
    for (const JsonValue& member : value.AsArray()) ExpectFiniteOrReason(member, name);
  if (!value.IsObject()) return;
  for (const auto& [key, member] : value.AsObject()) {
    ExpectFiniteOrReason(member, name + "." + key);
    const bool finite = !member.IsNumber() || std::isfinite(member.AsDouble());
    const bool reason = !member.IsNull() || key == "why" ||
                        value.Find(key + "_why") != nullptr || value.Find("why") != nullptr;
    EXPECT_TRUE(finite && reason) << name << "." << key;
  }
}

// Runs capture folder / "s" to folder / "e"; its report.
JsonValue ReportOf(const TemporaryFolder& folder, const std::vector<std::string>& more = {}) {
  testing::Said(RunOf(folder / "s/truth", folder / "e", more));
  JsonValue report = ReadJsonFile(folder / "e/styles/style_sunset/report.json");
  ExpectFiniteOrReason(report, "report");
  return report;
}

// The middle `width` x `height` pixels of photo `index` of a synthetic capture, camera to
// match.
void CropPhoto(const std::string& capture, size_t index, int width, int height) {
  const std::string file = capture + "/truth/transforms.json";
  std::vector<TransformsFrame> frames = ReadTransformsJson(file).frames;
  Camera& camera = frames[index].camera;
  const std::string path = capture + "/truth/" + frames[index].file;
  const Image photo = ReadImage(path);
  const int left = (photo.width - width) / 2, top = (photo.height - height) / 2;
  Image cropped(width, height);
  for (int y = 0; y < height; ++y)
    std::copy_n(photo.at(left, top + y), 3 * width, cropped.at(0, y));
  WritePng8(path, cropped);
  camera.width = width;
  camera.height = height;
  camera.cx -= left;
  camera.cy -= top;
  WriteTransformsJson(file, frames);
}

TEST(MixedSizes, H159_ThreeSizesOfTwoCamerasGoToFilmAndReport) {
  const TemporaryFolder folder;
  testing::Said({"synth", folder / "s", "--views", "6", "--size", "128x96", "--effects",
                 "mixed-cameras"});
  const ProgramOutcome done = Regrade(RunOf(folder / "s/truth", folder / "e"));
  ASSERT_EQ(done.code, 0) << done.text;
  EXPECT_SAYS(done, "one camera (64x48 px) at each photo's place");

  // Views keep their shape; compared frames and the film have a common one.
  EXPECT_EQ(SizeOf(folder / "e/styles/style_sunset/frames/styled/00000.png"), "64x48");
  EXPECT_EQ(SizeOf(folder / "e/styles/style_sunset/frames/styled/00001.png"), "48x64");
  EXPECT_EQ(SizeOf(folder / "e/styles/style_sunset/views_2d/00001.png"), "48x64");
  for (const char* sequence : {"source", "views_2d", "styled"})
    for (const char* frame : {"00000.png", "00001.png", "00002.png"})
      EXPECT_EQ(SizeOf(folder / (std::string("e/styles/style_sunset/frames/common_") +
                                 sequence + "/" + frame)),
                "64x48");
  EXPECT_FALSE(fs::exists(folder / "e/styles/style_sunset/frames/common_transmittance"));
  EXPECT_EQ(CountVideoFrames(folder / "e/styled.mp4"), 3);
  for (const auto& map : fs::directory_iterator(folder / "e/styles/style_sunset/heatmaps"))
    EXPECT_EQ(SizeOf(map.path().string()), "64x48") << map.path();

  const JsonValue report = ReadJsonFile(folder / "e/styles/style_sunset/report.json");
  ExpectFiniteOrReason(report, "report");
  // At the photos' places, of the common camera, along the film's path, and of the film.
  EXPECT_EQ(report.At("stages").At("render").At("frames").AsInt(), 6 + 6 + 3 + 3);
  EXPECT_EQ(report.At("stages").At("render").At("film").At("width").AsInt(), 64);
  EXPECT_NE(report.At("stages").At("evaluate").Find("comparison_note"), nullptr);
  EXPECT_EQ(testing::RowOf(report, "styled").At("pairs").AsInt(), 5);
  EXPECT_LT(testing::RowOf(report, "styled").At("undefined_pairs").AsInt(), 5);

  // A run that was killed among the common frames goes on to the same bytes.
  const int null = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  testing::Spawn(REGRADE_PROGRAM, RunOf(folder / "s/truth", folder / "k"), null, SIGKILL,
                 folder / "k/styles/style_sunset/frames/common_source/00001.png");
  const ProgramOutcome again = Regrade(RunOf(folder / "s/truth", folder / "k"));
  ::close(null);
  ASSERT_EQ(again.code, 0) << again.text;
  EXPECT_EQ(testing::ResultsOf(folder / "k") == testing::ResultsOf(folder / "e"), true);

  // Exact motion and the film of the views use the common camera, too.
  testing::Said({"evaluate", folder / "e", "--mode", "geometry", "--threads", "2"});
  const ProgramOutcome views = Regrade({"render", folder / "e", "--path", "views"});
  ASSERT_EQ(views.code, 0) << views.text;
  EXPECT_EQ(CountVideoFrames(folder / "e/styled.mp4"), 6);
  EXPECT_FALSE(fs::exists(folder / "e/styles/style_sunset/frames/path_source"));
  testing::Said(
      {"mix", folder / "e", "--mix", "0:1", "--path", "views", "--out", folder / "m"});
  EXPECT_EQ(SizeOf(folder / "m/frames/00001.png"), "48x64");
  EXPECT_EQ(CountVideoFrames(folder / "m/mixed.mp4"), 6);
  testing::Said({"contact-sheet", folder / "e", "--out", folder / "sheet.png", "--size", "64"});

  // Frames of another program that differ in size are a mistake.
  const ProgramOutcome sizes_differ =
      Regrade({"evaluate", "--frames", folder / "e/styles/style_sunset/frames/styled", "--out",
               folder / "f"});
  EXPECT_EQ(sizes_differ.code, 3);
  EXPECT_SAYS(sizes_differ, "48 x 64 px, 00000.png is 64 x 48 px");
  EXPECT_SAYS(sizes_differ, "render all frames at one size");
}

TEST(MixedSizes, H159_OnePhotoOfAnotherShape) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 5, "128x96");
  CropPhoto(folder / "s", 0, 72, 96);  // the first photo does not determine the common camera
  ReportOf(folder);
  EXPECT_EQ(SizeOf(folder / "e/styles/style_sunset/frames/source/00000.png"), "48x64");
  EXPECT_EQ(SizeOf(folder / "e/styles/style_sunset/frames/common_source/00000.png"), "64x48");
  EXPECT_EQ(SizeOf(folder / "e/styles/style_sunset/frames/path_source/00000.png"), "64x48");
}

TEST(MixedSizes, H159_OneOfEachAndAPanorama) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 4, "384x96");
  CropPhoto(folder / "s", 0, 128, 96);
  CropPhoto(folder / "s", 1, 96, 96);
  CropPhoto(folder / "s", 2, 72, 96);
  ReportOf(folder, {"--config", R"({"pose-min-photos": 4})"});
  EXPECT_EQ(SizeOf(folder / "e/styles/style_sunset/frames/source/00003.png"), "64x16");
  EXPECT_EQ(SizeOf(folder / "e/styles/style_sunset/frames/common_source/00003.png"), "64x48");
}

// Frames too small for flow have no consistency, and the report says why.
TEST(MixedSizes, H159_FramesBelowTheFlowsPyramidHaveAReason) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 4, "512x64");
  const JsonValue report = ReportOf(folder, {"--config", R"({"pose-min-photos": 4})"});
  EXPECT_EQ(SizeOf(folder / "e/styles/style_sunset/frames/source/00000.png"), "64x8");
  const JsonValue& row = testing::RowOf(report, "styled");
  EXPECT_EQ(row.At("undefined_pairs").AsInt(), 3);
  EXPECT_TRUE(row.At("tc_psnr_mean_db").IsNull());
  EXPECT_NE(row.At("tc_psnr_mean_db_why").AsString().find("too small for optical flow"),
            std::string::npos);
}

// The photos' masks do not fit the common camera: coverage is rendered from the field.
TEST(MixedSizes, H159_MasksOfPhotosThatDiffer) {
  const TemporaryFolder folder;
  testing::Said({"synth", folder / "s", "--views", "5", "--size", "128x96", "--effects",
                 "mixed-cameras,masks"});
  ReportOf(folder, {"--masks", folder / "s/truth/masks"});
  EXPECT_EQ(SizeOf(folder / "e/styles/style_sunset/frames/common_views_2d/00001.png"), "64x48");
}

}  // namespace
}  // namespace regrade
