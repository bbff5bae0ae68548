// `regrade evaluate --splats`: files of splats of any program at the same cameras.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "evaluate/consistency.h"
#include "pipeline/capture/capture_cameras.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/read_splats.h"
#include "pipeline/fields/splat_ply.h"
#include "pipeline/files/json_file.h"
#include "pipeline/stages/foreign_splats.h"
#include "reconstruct/colmap/colmap_model.h"
#include "tests/support/evaluated_frames.h"
#include "tests/support/expect_error.h"
#include "tests/support/source_dir.h"
#include "tests/support/splat_ball.h"
#include "tests/support/splat_bytes.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

using testing::Evaluate;
using testing::ProgramOutcome;
using testing::TemporaryFolder;
using testing::WriteText;

constexpr int kShots = 8;

// On an arc around the ball, or around `middle`, 5 degrees apart.
std::vector<BareCamera> Shots(const Vec3d& middle = {}) {
  std::vector<BareCamera> shots;
  for (int i = 0; i < kShots; ++i) {
    const double angle = 5 * M_PI / 180 * i;
    BareCamera shot{"shot" + std::to_string(i), {}};
    shot.camera.width = 80, shot.camera.height = 60;
    shot.camera.fx = shot.camera.fy = 90;
    shot.camera.cx = 40, shot.camera.cy = 30;
    const Vec3d front{-std::cos(angle), 0, -std::sin(angle)}, down{0, 1, 0};
    RigidTransform& pose = shot.camera.camera_from_world;
    pose.rotation.row[0] = Cross(down, front);
    pose.rotation.row[1] = down;
    pose.rotation.row[2] = front;
    pose.translation = -(pose.rotation * (middle - front * 2.0));
    shots.push_back(shot);
  }
  return shots;
}

// The ball in other colours.
Splats Restyled(const Splats& splats, float factor) {
  Splats styled = splats;
  for (float& value : styled.sh) value *= factor;
  return styled;
}

Splats Moved(const Splats& splats, float by) {
  Splats moved = splats;
  for (size_t i = 0; i < moved.mean.size(); i += 3) moved.mean[i] += by;
  return moved;
}

// plain.ply, strong.ply, weak.ply and the shots' cameras.json in a folder.
class EvaluateSplatFiles : public ::testing::Test {
 protected:
  EvaluateSplatFiles() {
    WriteSplatPly(folder_ / "plain.ply", {testing::SplatBall(600), {}, {}}, "a ball");
    plain_ = ReadSplats(folder_ / "plain.ply").splats;
    Write("strong.ply", Restyled(plain_, 1.6f));
    Write("weak.ply", Restyled(plain_, 0.5f));
    WriteCamerasJson(folder_ / "cameras.json", Shots());
  }

  void Write(const std::string& name, const Splats& splats) {
    WriteText(folder_ / name, testing::PlyOf(splats));
  }

  ProgramOutcome Score(const std::vector<std::string>& files,
                       const std::vector<std::string>& more = {}) {
    std::vector<std::string> words{"--reference", folder_ / "plain.ply", "--cameras",
                                   folder_ / "cameras.json", "--splats"};
    for (const std::string& file : files) words.push_back(folder_ / file);
    words.insert(words.end(), more.begin(), more.end());
    return Evaluate(words);
  }

  JsonValue ReportOf(const std::string& out) const {
    return ReadJsonFile(folder_ / (out + "/report.json"));
  }

  TemporaryFolder folder_;
  Splats plain_;
};

// A frame as its file of 8 bits has it.
Image InEightBits(Image image) {
  for (float& value : image.pixels) value = std::floor(255 * value + 0.5f) / 255;
  return image;
}

// The same numbers by another road: frames and depth in memory, without files between.
TEST_F(EvaluateSplatFiles, MotionIsThatOfTheReferencesDepth) {
  const ProgramOutcome outcome = Score({"strong.ply"}, {"--out", folder_ / "out"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_SAYS(outcome, "8 frames at the cameras of ");
  const JsonValue report = ReportOf("out");
  EXPECT_EQ(report.At("stages").At("evaluate").At("protocol").AsString(), "geometry");
  EXPECT_EQ(report.Find("remarks"), nullptr);

  std::vector<Image> depth;
  const auto frames = [&](const std::string& file) {
    const SplatScene scene = ReadSplats(folder_ / file);
    const FieldRenderer renderer(FieldInItsWorld(scene), Backend::kCpu);
    std::vector<Image> pictures;
    for (const auto& [name, camera] : Shots()) {
      const RenderedView view = renderer.Render(camera);
      pictures.push_back(InEightBits(view.color));
      if (file == "plain.ply") depth.push_back(DepthAlongRays(camera, view.depth));
    }
    return FrameSource{kShots, [pictures](int i) { return pictures[static_cast<size_t>(i)]; }};
  };
  const FrameSource plain = frames("plain.ply"), strong = frames("strong.ply");
  ConsistencyOptions options{.mode = "geometry"};
  const ConsistencyReport expected = EvaluateConsistency(
      plain, {{"source", plain}, {"styled", strong}}, options, {}, [&](int i) {
        return FrameGeometry{depth[static_cast<size_t>(i)],
                             Shots()[static_cast<size_t>(i)].camera};
      });
  ASSERT_EQ(expected.rows.size(), 4u);
  for (const ConsistencyRow& row : expected.rows) {
    const JsonValue found = RowOf(report, row.sequence, row.gap);
    EXPECT_GT(row.coverage, 0.1);
    EXPECT_EQ(found.At("pairs").AsInt(), kShots - row.gap);
    // Poses go through files in double precision; a GPU rounds some pixels to another level.
    EXPECT_NEAR(found.At("tc_psnr_mean_db").AsDouble(), row.tc_psnr_mean_db.value(), 0.01);
    EXPECT_NEAR(found.At("coverage").AsDouble(), row.coverage, 1e-3);
  }
  // Colours that depend more on the direction are less consistent.
  EXPECT_LT(RowOf(report, "styled").At("tc_psnr_mean_db").AsDouble(),
            RowOf(report, "source").At("tc_psnr_mean_db").AsDouble() - 2);

  // What is kept is enough for the same numbers, and for frames of other methods.
  const std::string kept = folder_ / "out/rendered/";
  const ProgramOutcome again =
      Evaluate({"--frames", kept + "styled", "--reference", kept + "source", "--cameras",
                kept + "transforms.json", "--depth", kept + "depth", "--protocol", "geometry",
                "--out", folder_ / "again"});
  ASSERT_EQ(again.code, 0) << again.text;
  EXPECT_EQ(DumpJson(ReportOf("again").At("consistency")),
            DumpJson(ReportOf("out").At("consistency")));
}

// Files have no background: it is white where that is asked for, that of a folder of regrade
// where it gives the cameras, and else black.
TEST_F(EvaluateSplatFiles, TheBackgroundIsChosen) {
  const auto corner = [&](const std::string& cameras, const std::vector<std::string>& more) {
    const ProgramOutcome outcome = Evaluate(
        testing::Joined({"--splats", folder_ / "weak.ply", "--reference", folder_ / "plain.ply",
                         "--cameras", cameras, "--gaps", "1", "--out", folder_ / "out"},
                        more));
    EXPECT_EQ(outcome.code, 0) << outcome.text;
    const Image frame = ReadImage(folder_ / "out/rendered/styled/00003.png");
    return Vec3f{frame.at(0, 0)[0], frame.at(0, 0)[1], frame.at(0, 0)[2]};
  };
  EXPECT_EQ(Norm(corner(folder_ / "cameras.json", {})), 0);
  EXPECT_EQ(Norm(corner(folder_ / "cameras.json", {"--background", "white"}) - Vec3f{1, 1, 1}),
            0);
  const StoredField stored{testing::SplatBall(600), {}, {}};
  std::filesystem::create_directories(folder_ / "run");
  WriteFieldFile(folder_ / "run/field.npz", stored);
  WriteCamerasJson(folder_ / "run/cameras.json", Shots());
  const Vec3f background = stored.field.background;
  ASSERT_GT(Norm(background), 0.1f);
  // Half a level of 8 bits in each channel.
  EXPECT_LT(Norm(corner(folder_ / "run", {}) - background), 0.9f / 255);
}

TEST_F(EvaluateSplatFiles, SeveralFilesAreComparedWithTheFirst) {
  const ProgramOutcome outcome =
      Score({"strong.ply", "weak.ply", "strong.ply"},
            {"--name", "Ours", "Other", "Copy", "--gaps", "1", "--out", folder_ / "out"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_SAYS(outcome, "minus Ours");
  const JsonValue report = ReportOf("out");
  EXPECT_EQ(report.At("labels").At("styled_2").AsString(), "Other");
  EXPECT_GT(RowOf(report, "styled_2").At("tc_psnr_difference_db").AsDouble(), 3);
  EXPECT_EQ(RowOf(report, "styled_3").At("tc_psnr_difference_db").AsDouble(), 0);
  // Fewer files leave no frames of the earlier call.
  ASSERT_EQ(Score({"weak.ply"}, {"--out", folder_ / "out"}).code, 0);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out/rendered/styled/00007.png"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/rendered/styled_2"));
}

// A file that is compared with itself: equal in all, infinitely close to its own frames.
TEST_F(EvaluateSplatFiles, TheReferenceItselfIsNoWorseThanTheReference) {
  const std::string style = testing::SourceDir() + "/assets/style_sunset.png";
  ASSERT_EQ(Score({"plain.ply"}, {"--out", folder_ / "first"}).code, 0);
  const ProgramOutcome outcome =
      Score({"plain.ply"}, {"--style", style, "--out", folder_ / "out", "--target",
                            folder_ / "first/rendered/source"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  const JsonValue report = ReportOf("out");
  for (const int gap : {1, 5})
    EXPECT_EQ(RowOf(report, "styled", gap).At("tc_psnr_mean_db").AsDouble(),
              RowOf(report, "source", gap).At("tc_psnr_mean_db").AsDouble());
  for (const JsonValue& row : report.At("fidelity").AsArray()) {
    EXPECT_TRUE(row.At("psnr_to_2d_db_infinite").AsBool()) << DumpJson(row);
    EXPECT_EQ(row.At("structure").AsDouble(), 1) << DumpJson(row);
    EXPECT_GT(row.At("sliced_wasserstein_to_style").AsDouble(), 0.05) << DumpJson(row);
  }
}

TEST_F(EvaluateSplatFiles, AnotherGeometryIsSaid) {
  Write("moved.ply", Moved(plain_, 0.3f));
  Write("elsewhere.ply", Moved(plain_, 300));
  const ProgramOutcome moved = Score({"moved.ply"}, {"--gaps", "1", "--out", folder_ / "out"});
  ASSERT_EQ(moved.code, 0) << moved.text;
  EXPECT_SAYS(moved, "not at the depth of the reference's");
  EXPECT_NE(ReportOf("out").At("remarks").AsArray().at(0).AsString().find("moved.ply: "),
            std::string::npos);
  const ProgramOutcome elsewhere = Score({"elsewhere.ply"});
  EXPECT_EQ(elsewhere.code, 3) << elsewhere.text;
  EXPECT_SAYS(elsewhere, "elsewhere.ply: no camera sees anything of these splats");
}

TEST_F(EvaluateSplatFiles, CamerasDecideWhatIsSeen) {
  WriteCamerasJson(folder_ / "cameras.json", Shots({0, 500, 0}));
  const ProgramOutcome nothing = Score({"weak.ply"}, {"--out", folder_ / "out"});
  EXPECT_EQ(nothing.code, 3) << nothing.text;
  EXPECT_SAYS(nothing, "plain.ply: no camera sees anything of these splats");
  EXPECT_SAYS(nothing, "--cameras in the world of the splats");
  std::vector<BareCamera> shots = Shots();
  shots[7].camera.camera_from_world = shots[0].camera.camera_from_world;
  shots[7].camera.camera_from_world.translation.y += 500;
  WriteCamerasJson(folder_ / "cameras.json", shots);
  const ProgramOutcome one = Score({"weak.ply"}, {"--out", folder_ / "out"});
  EXPECT_EQ(one.code, 0) << one.text;
  EXPECT_SAYS(one, "plain.ply: 1 of 8 frames show nothing of it");
}

// Photos in no order are flown past, as by a film; views without cameras are placed first.
TEST_F(EvaluateSplatFiles, CamerasWithoutOrderBecomeAPath) {
  std::vector<BareCamera> shots = Shots();
  for (int i = 0; i < kShots; ++i)
    shots[static_cast<size_t>(i)].name = "shot" + std::to_string((5 * i) % kShots);
  WriteCamerasJson(folder_ / "cameras.json", shots);
  const ProgramOutcome mixed = Score({"weak.ply"}, {"--gaps", "1", "--out", folder_ / "out"});
  ASSERT_EQ(mixed.code, 0) << mixed.text;
  EXPECT_SAYS(mixed, "120 frames of a path past the cameras of ");
  EXPECT_EQ(RowOf(ReportOf("out"), "styled").At("pairs").AsInt(), 119);

  const ProgramOutcome placed =
      Evaluate({"--splats", folder_ / "weak.ply", "--reference", folder_ / "plain.ply",
                "--size", "64", "--gaps", "1"});
  ASSERT_EQ(placed.code, 0) << placed.text;
  EXPECT_SAYS(placed, "120 frames of a path past the placed views, 64x");
}

TEST_F(EvaluateSplatFiles, WhatIsNoSceneIsRefused) {
  const std::string plain = folder_ / "plain.ply", weak = folder_ / "weak.ply";
  Write("empty.ply", Splats(0, 1));
  WriteText(folder_ / "text.ply", "no splats");
  std::filesystem::create_directories(folder_ / "frames");
  struct Case {
    std::vector<std::string> words;
    int code;
    std::string part;
  };
  for (const Case& wrong : std::vector<Case>{
           {{"--splats", weak}, 2, "add --reference FILE"},
           {{"--reference", plain}, 2, "or --splats FILE"},
           {{"--splats", weak, "--reference", plain, "--frames", folder_ / "frames"},
            2,
            "--frames: frames of --splats are rendered here"},
           {{"--splats", weak, "--reference", plain, "--depth", folder_ / "frames"},
            2,
            "--depth"},
           {{"--splats", weak, "--reference", plain, "--name", "a", "b"}, 2, "2 names for 1"},
           {{"--frames", folder_ / "frames", "--cameras", "c.json"}, 2, "--protocol geometry"},
           {{"--frames", folder_ / "frames", "--size", "99"}, 2, "belongs to --splats"},
           {{"--splats", folder_ / "frames", "--reference", plain}, 3, "is a folder"},
           {{"--splats", weak, "--reference", folder_ / "frames"}, 3, "is a folder"},
           {{"--splats", weak, "--reference", folder_ / "empty.ply"}, 3, "empty.ply"},
           {{"--splats", folder_ / "text.ply", "--reference", plain, "--cameras",
             folder_ / "cameras.json"},
            3,
            "text.ply"},
           {{"--splats", weak, "--reference", plain, "--cameras", folder_ / "frames"},
            3,
            "has no cameras"},
           {{"--splats", folder_ / "not.ply", "--reference", plain, "--cameras",
             folder_ / "cameras.json"},
            3,
            "not.ply"}}) {
    const ProgramOutcome outcome = Evaluate(wrong.words);
    EXPECT_EQ(outcome.code, wrong.code) << wrong.part << "\n" << outcome.text;
    EXPECT_SAYS(outcome, wrong.part);
  }
}

// Captures whose photos are there give the same cameras as their files, in the photos' order.
TEST(CaptureCameras, PhotosMayBeThere) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 11, "96x72");
  const TransformsFile truth = ReadTransformsJson(folder / "s/truth/transforms.json");
  const auto expect_truth = [&](const std::string& capture) {
    const std::vector<BareCamera> cameras = CamerasOfCapture(capture, {});
    ASSERT_EQ(cameras.size(), truth.frames.size());
    for (size_t i = 0; i < cameras.size(); ++i) {
      const Camera &found = cameras[i].camera, &exact = truth.frames[i].camera;
      EXPECT_LT(Norm(found.Center() - exact.Center()), 1e-9) << cameras[i].name;
      EXPECT_LT(Norm(found.Forward() - exact.Forward()), 1e-9);
      EXPECT_EQ(found.width, 96);
      EXPECT_NEAR(found.fx, exact.fx, 1e-9);
    }
  };
  expect_truth(folder / "s/truth");
  // A COLMAP model lists photos in any order.
  ColmapModel model;
  for (size_t i = truth.frames.size(); i-- > 0;) {
    const Camera& camera = truth.frames[i].camera;
    const auto id = static_cast<uint32_t>(truth.frames.size() - i);
    model.cameras.push_back({id, ColmapLens::kPinhole, camera});
    model.images.push_back({id,
                            id,
                            std::filesystem::path(truth.frames[i].file).filename().string(),
                            camera.camera_from_world,
                            {}});
  }
  std::filesystem::create_directories(folder / "c/sparse/0");
  std::filesystem::copy(folder / "s/images", folder / "c/images");
  WriteColmapModel(model, folder / "c/sparse/0");
  expect_truth(folder / "c");
  EXPECT_REGRADE_ERROR(CamerasOfCapture(folder / "s/images", {}), ExitCode::kInput,
                       "has no cameras");
}

}  // namespace
}  // namespace regrade
