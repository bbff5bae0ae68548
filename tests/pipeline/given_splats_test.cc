// Runs of a file of splats in place of photos: with cameras, without, and what is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "kernels/splats/splat_field.h"
#include "pipeline/capture/bare_cameras.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/read_splats.h"
#include "pipeline/fields/splat_ply.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/source_dir.h"
#include "tests/support/splat_ball.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::ProgramOutcome;
using testing::ReadText;
using testing::Regrade;
using testing::TemporaryFolder;
using testing::WriteText;

constexpr int64_t kSplats = 600;

// The ball, far from the origin and large, as files may be.
StoredField Ball() {
  StoredField stored{testing::SplatBall(kSplats), {}, {}};
  stored.field_from_world.scale = 0.25;
  stored.field_from_world.translation = {1, -2, 0.5};
  return stored;
}

Vec3d MiddleOfBall() { return Vec3d{-1, 2, -0.5} / 0.25; }

void WriteBall(const std::string& path) { WriteSplatPly(path, Ball(), "a ball"); }

std::vector<std::string> RunOf(const std::string& splats, const std::string& out,
                               const std::vector<std::string>& more) {
  return testing::Joined(
      testing::Joined({"run", splats, "--out", out, "--device", "cpu", "--style",
                       testing::SourceDir() + "/assets/style_sunset.png"},
                      testing::TinyFlags("")),
      more);
}

// cameras.json as 3D Gaussian Splatting writes it: cameras on a circle around the ball, who
// look at it with y down.
std::string CamerasJson(int count, const Vec3d& middle) {
  JsonValue list = JsonValue::Array();
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * 3.141592653589793 * i / count;
    const Vec3d front{-std::cos(angle), 0, -std::sin(angle)}, down{0, 1, 0},
        right = Cross(down, front), at = middle - front * 9.0;
    JsonValue rotation = JsonValue::Array(), position = JsonValue::Array();
    for (int r = 0; r < 3; ++r) {
      JsonValue row = JsonValue::Array();
      for (const double value : {right[r], down[r], front[r]}) row.Append(value);
      rotation.Append(std::move(row));
      position.Append(at[r]);
    }
    list.Append(JsonValue::Object{{"id", i},
                                  {"img_name", "shot" + std::to_string(i)},
                                  {"width", 80},
                                  {"height", 60},
                                  {"position", position},
                                  {"rotation", rotation},
                                  {"fx", 90.0},
                                  {"fy", 90.0}});
  }
  return DumpJson(list);
}

// The splats of a file in the coordinates of another one, vertex by vertex.
void ExpectSamePlaces(const std::string& a, const std::string& b) {
  const SplatScene one = ReadSplats(a), other = ReadSplats(b);
  EXPECT_EQ(one.splats.mean, other.splats.mean);
  EXPECT_EQ(one.splats.log_scale, other.splats.log_scale);
  EXPECT_EQ(one.splats.quaternion, other.splats.quaternion);
  EXPECT_EQ(one.splats.opacity_logit, other.splats.opacity_logit);
  EXPECT_NE(one.splats.sh, other.splats.sh);
}

// The scene and its style in each format: one geometry, and what is lost is small and said.
void ExpectExports(const TemporaryFolder& folder, const Capture& capture) {
  const std::string run = folder / "o";
  const SplatScene exact = ReadSplats(folder / "ball.ply");
  for (const auto& [format, ending] :
       {std::pair{"ply", ".ply"}, std::pair{"spz", ".spz"}, std::pair{"glb", ".glb"},
        std::pair{"compressed-ply", ".compressed.ply"}}) {
    SCOPED_TRACE(format);
    const std::string to = folder / (std::string("as_") + format);
    ProgramOutcome done = Regrade({"export", run, "--format", format, "--out", to});
    ASSERT_EQ(done.code, 0) << done.text;
    const std::string scene = to + "/field" + ending, style = to + "/sun" + ending;
    ASSERT_TRUE(fs::exists(scene) && fs::exists(style));
    const bool rounded =
        std::string(format) == "spz" || std::string(format) == "compressed-ply";
    const size_t loss = done.text.find("renders are ");
    EXPECT_EQ(loss != std::string::npos, rounded) << done.text;
    if (rounded) {
      EXPECT_GT(std::stod(done.text.substr(loss + 12)), 36) << done.text;
    }
    if (std::string(format) != "glb") {
      ExpectSamePlaces(scene, style);
      // In the world of the file that was given.
      const Splats back = ReadSplats(scene).splats;
      Vec3d middle, given_middle;
      for (int64_t i = 0; i < kSplats; ++i) {
        middle += back.view()[i].mean.Cast<double>() / double(kSplats);
        given_middle += exact.splats.view()[i].mean.Cast<double>() / double(kSplats);
      }
      EXPECT_LT(Norm(middle - given_middle), 1e-2);
    }
    const std::vector<BareCamera> cameras = ReadCamerasJson(to + "/cameras.json");
    ASSERT_EQ(cameras.size(), capture.views.size());
    EXPECT_LT(Norm(cameras[1].camera.Center() - capture.views[1].camera.Center()), 1e-9);
    EXPECT_EQ(cameras[1].name, capture.views[1].file);
    const JsonValue turn = ReadJsonFile(to + "/transform.json").At("world_from_file");
    const bool is_ply = std::string(ending).ends_with("ply");
    EXPECT_EQ(turn.AsArray()[1].AsArray()[1].AsDouble(), is_ply ? 1 : -1);

    done = Regrade({"export", run, "--format", format, "--name", "sun", "--out", to + "s"});
    ASSERT_EQ(done.code, 0) << done.text;
    EXPECT_FALSE(fs::exists(to + "s/field" + ending));
    EXPECT_TRUE(ReadText(to + "s/sun" + ending) == ReadText(style));
  }
  const std::string to = folder / "not";
  ProgramOutcome done = Regrade({"export", run, "--format", "points", "--out", to});
  EXPECT_EQ(done.code, static_cast<int>(ExitCode::kUsage));
  EXPECT_SAYS(done, "use --format ply");
  done = Regrade({"export", run, "--format", "ply", "--name", "moon", "--out", to});
  EXPECT_EQ(done.code, static_cast<int>(ExitCode::kInput));
  done = Regrade({"export", run, "--name", "sun", "--out", to});
  EXPECT_EQ(done.code, static_cast<int>(ExitCode::kUsage));
  for (const char* format : {"ply", "transforms"}) {
    done = Regrade({"export", run, "--format", format, "--splats", "9", "--out", to});
    EXPECT_EQ(done.code, static_cast<int>(ExitCode::kUsage));
    EXPECT_SAYS(done, "--splats");
  }
  EXPECT_FALSE(fs::exists(to));
}

TEST(GivenSplats, ViewsArePlacedAndTheStyleIsWrittenBack) {
  const TemporaryFolder folder;
  WriteBall(folder / "ball.ply");
  const ProgramOutcome done =
      Regrade(RunOf(folder / "ball.ply", folder / "o", {"--name", "sun"}));
  ASSERT_EQ(done.code, 0) << done.text;
  EXPECT_SAYS(done, "600 splats");
  EXPECT_SAYS(done, "an object, seen from outside");
  const Capture capture = ReadCapture(folder / "o/poses");
  EXPECT_TRUE(capture.rendered);
  EXPECT_GE(capture.views.size(), 24u);
  EXPECT_GE(capture.points.size(), 100u);
  for (const CaptureView& view : capture.views) {  // all around it, none within
    const Vec3d to = MiddleOfBall() - view.camera.Center();
    EXPECT_GT(Norm(to), 4);
    EXPECT_GT(Dot(Normalized(to), view.camera.Forward()), 0.99);
    EXPECT_LT(view.camera.Up().y, 0);
  }
  const JsonValue report = ReadJsonFile(folder / "o/styles/sun/report.json");
  EXPECT_TRUE(DumpJson(report).find("there are no photos") != std::string::npos);
  EXPECT_TRUE(fs::exists(folder / "o/styles/sun/styled.mp4"));
  // What the splats leave empty stays as it was, in the method's pictures and in the scene's.
  for (const char* name : {"views_2d/00000.png", "frames/path_styled/00000.png"}) {
    const Image picture = ReadImage(folder / (std::string("o/styles/sun/") + name));
    EXPECT_EQ(*std::ranges::max_element(picture.pixels.begin(), picture.pixels.begin() + 30), 0)
        << name;
    EXPECT_GT(*std::ranges::max_element(picture.pixels), 0.3f) << name;
  }

  // The field has the file's splats, and leads back to its coordinates.
  const StoredField stored = ReadFieldFile(folder / "o/field.npz");
  const SplatsView<float> splats = SplatsOf(stored.field);
  ASSERT_EQ(splats.count, kSplats);
  const SplatScene file = ReadSplats(folder / "ball.ply");
  for (int64_t i = 0; i < kSplats; ++i) {
    const Vec3d there = stored.field_from_world * file.splats.view()[i].mean.Cast<double>();
    EXPECT_LT(Norm(there - splats[i].mean.Cast<double>()), 1e-5) << i;
  }
  const std::string styled = folder / "o/styles/sun/styled.ply";
  ExpectSamePlaces(styled, folder / "ball.ply");
  const std::string header = ReadText(styled).substr(0, 300);
  EXPECT_NE(header.find("comment a ball"), std::string::npos) << header;
  EXPECT_NE(header.find("style sun, Lipschitz bound"), std::string::npos) << header;
  ExpectExports(folder, capture);
}

TEST(GivenSplats, CamerasOfAFileAreUsedAndTheRunIsContinued) {
  const TemporaryFolder folder;
  WriteBall(folder / "ball.ply");
  WriteText(folder / "cameras.json", CamerasJson(8, MiddleOfBall()));
  const std::vector<std::string> run =
      RunOf(folder / "ball.ply", folder / "o",
            {"--cameras", folder / "cameras.json", "--no-films", "--until", "render"});
  ProgramOutcome done = Regrade(run);
  ASSERT_EQ(done.code, 0) << done.text;
  const Capture capture = ReadCapture(folder / "o/poses");
  ASSERT_EQ(capture.views.size(), 8u);
  EXPECT_EQ(capture.views[3].file, "shot3");
  EXPECT_EQ(capture.views[3].camera.width, 80);
  // The pictures are those of the field.
  const StoredField stored = ReadFieldFile(folder / "o/field.npz");
  const std::string field = ReadText(folder / "o/field.npz");
  EXPECT_NEAR(Norm(stored.field_from_world * MiddleOfBall()), 0, 0.2);
  done = Regrade(run);
  ASSERT_EQ(done.code, 0) << done.text;
  EXPECT_EQ(ReadText(folder / "o/field.npz"), field);
  // What a style leaves as it is keeps the file's bits.
  const std::string sunset = testing::SourceDir() + "/assets/style_sunset.png";
  done = Regrade({"stylize", folder / "o", "--style", sunset, "--strength", "0"});
  ASSERT_EQ(done.code, 0) << done.text;
  std::string same = ReadText(folder / "o/styles/style_sunset/styled.ply");
  const size_t comment = same.find("comment restyled by");
  same.erase(comment, same.find('\n', comment) + 1 - comment);
  EXPECT_TRUE(same == ReadText(folder / "ball.ply"));
  // Further styles of the folder have their file, too, also where the splats are gone.
  fs::remove(folder / "ball.ply");
  done = Regrade({"stylize", folder / "o", "--style",
                  testing::SourceDir() + "/assets/style_night.png", "--name", "night"});
  ASSERT_EQ(done.code, 0) << done.text;
  EXPECT_EQ(ReadSplats(folder / "o/styles/night/styled.ply").splats.count(), kSplats);
}

// The photos' poses are those of the splats' world; of a capture's photos some are held out.
TEST(GivenSplats, PhotosWithPosesMeasureTheSplats) {
  const TemporaryFolder folder;
  ASSERT_EQ(Regrade({"synth", folder / "s", "--views", "6", "--size", "96x72"}).code, 0);
  std::vector<std::string> fit{"reconstruct", folder / "s/truth", "--out",
                               folder / "a",  "--device",         "cpu"};
  for (const char* flag : {"--photo-size", "64", "--splat-steps", "60", "--splats", "2",
                           "--tracks", "given", "--config", R"({"scene-background": 0})"})
    fit.push_back(flag);
  ProgramOutcome done = Regrade(fit);
  ASSERT_EQ(done.code, 0) << done.text;
  testing::Said({"export", folder / "a", "--format", "ply", "--out", folder / "p"});
  done = Regrade({"reconstruct", folder / "p/field.ply", "--cameras", folder / "s/truth",
                  "--out", folder / "b", "--photo-size", "64", "--device", "cpu"});
  ASSERT_EQ(done.code, 0) << done.text;
  const auto psnr = [&](const char* run) {
    return ReadJsonFile(folder / (std::string(run) + "/.regrade/stages/reconstruct.json"))
        .At("metrics")
        .At("psnr_heldout_db")
        .AsDouble();
  };
  // The same field, up to the near plane and rounding; a file has a black background.
  EXPECT_NEAR(psnr("b"), psnr("a"), 0.3);
}

TEST(GivenSplats, WhatDoesNotFitIsRefused) {
  const TemporaryFolder folder;
  WriteBall(folder / "ball.ply");
  WriteText(folder / "text.ply", "no splats at all");
  WriteText(folder / "points.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
            "property float z\nend_header\n1 2 3\n");
  WriteText(folder / "other.json", CamerasJson(8, {500, 0, 0}));
  WriteText(folder / "broken.json", "[{\"img_name\": \"a\", \"width\": 80}]");
  fs::create_directories(folder / "empty");
  const auto refuses = [&](const std::string& splats, const std::vector<std::string>& more,
                           int code, const std::string& part) {
    const ProgramOutcome done = Regrade(RunOf(splats, folder / "o", more));
    EXPECT_EQ(done.code, code) << done.text;
    EXPECT_SAYS(done, part);
    fs::remove_all(folder / "o");
  };
  const int input = static_cast<int>(ExitCode::kInput),
            usage = static_cast<int>(ExitCode::kUsage);
  refuses(folder / "text.ply", {}, input, "text.ply");
  refuses(folder / "points.ply", {}, input, "opacity");
  const std::string ball = folder / "ball.ply";
  refuses(ball, {"--cameras", folder / "other.json"}, input, "next to nothing of the splats");
  refuses(ball, {"--cameras", folder / "broken.json"}, input, "height");
  refuses(ball, {"--cameras", folder / "empty"}, input, "has no cameras");
  refuses(ball, {"--cameras", folder / "none"}, input, "no such folder or file");
  refuses(ball, {"--up", "z", "--cameras", folder / "other.json"}, usage, "--up and --cameras");
  refuses(ball, {"--splat-steps", "9"}, usage, "is not fitted");
  refuses(folder / "empty", {"--cameras", folder / "other.json"}, usage, "--cameras");
}

}  // namespace
}  // namespace regrade
