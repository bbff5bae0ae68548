// Depths that a network guesses: their scale and shift, and where they become points. The
// network of these tests is the mean of a photo's channels.
#include "pipeline/capture/guessed_depths.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>

#include "kernels/synthetic/ray_trace.h"
#include "kernels/synthetic/synthetic_scene.h"
#include "pipeline/images/image_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/source_dir.h"
#include "tests/support/spawn.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_onnx.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::TemporaryFolder;

// A ramp of depths from 2 to 10, as known at some places, a fifth of them wrong by half.
struct Ramp {
  Image z{40, 30, 1};
  std::vector<KnownDepth> known;

  explicit Ramp(int places) {
    for (int y = 0; y < z.height; ++y)
      for (int x = 0; x < z.width; ++x)
        z.at(x, y)[0] = 2 + 8 * static_cast<float>(x + y) / static_cast<float>(68);
    for (int i = 0; i < places; ++i) {
      const int x = i * 7 % z.width, y = i * 11 % z.height;
      known.push_back({x + 0.5, y + 0.5, double{z.at(x, y)[0]} * (i % 5 == 0 ? 1.5 : 1.0)});
    }
  }
  Image Guess(const std::function<float(float)>& of_z) const {
    Image guess = z;
    for (float& value : guess.pixels) value = of_z(value);
    return guess;
  }
};

TEST(AlignGuess, ScaleAndShiftAreFoundBesideOutliers) {
  const Ramp ramp(100);
  for (const auto& guess :
       {ramp.Guess([](float z) { return 300 / z - 20; }),
        ramp.Guess([](float z) { return 4 - 1 / z; }), ramp.Guess([](float z) { return z; }),
        ramp.Guess([](float z) { return 0.01f * z - 3; })}) {
    const std::optional<AlignedGuess> aligned = AlignGuess(guess, ramp.known);
    ASSERT_TRUE(aligned);
    EXPECT_LT(aligned->error, 0.01);
    for (size_t i = 0; i < ramp.z.pixels.size(); ++i)
      ASSERT_NEAR(aligned->z.pixels[i], ramp.z.pixels[i], 0.01f * ramp.z.pixels[i]);
  }
}

// Of a sky there is no point; its inverse depth is next to 0.
TEST(AlignGuess, WhatIsFarBeyondThePointsIsNoDepth) {
  const Ramp ramp(100);
  Image guess = ramp.Guess([](float z) { return 1 / z; });
  for (int x = 0; x < guess.width; ++x) guess.at(x, 0)[0] = 0.01f;
  std::vector<KnownDepth> known = ramp.known;
  std::erase_if(known, [](const KnownDepth& at) { return at.y < 1; });
  const std::optional<AlignedGuess> aligned = AlignGuess(guess, known);
  ASSERT_TRUE(aligned);
  for (int x = 0; x < guess.width; ++x) EXPECT_EQ(aligned->z.at(x, 0)[0], 0) << x;
  EXPECT_GT(aligned->z.at(5, 5)[0], 2);
}

TEST(AlignGuess, WhatKnowsNothingIsLeftOut) {
  const Ramp ramp(100);
  int i = 0;
  EXPECT_FALSE(AlignGuess(
      ramp.Guess([&i](float) { return static_cast<float>(++i * 7919 % 1009); }), ramp.known));
  EXPECT_FALSE(AlignGuess(ramp.Guess([](float) { return 1.0f; }), ramp.known));
  EXPECT_FALSE(AlignGuess(ramp.z, Ramp(19).known));
}

// Photos whose grey is inverse depth, stretched over each photo's range.
TEST(GuessedDepths, BecomePointsOfAFitWherePhotosHaveNone) {
  const TemporaryFolder folder;
  ASSERT_EQ(testing::Regrade({"synth", folder / "s", "--views", "6", "--size", "96x72",
                              "--effects", "poses", "--no-flow"})
                .code,
            0);
  const SyntheticScene scene = MakeSyntheticScene("table", 0);
  const std::vector<Camera> cameras = SyntheticCameras(scene, 6, 96, 72);
  for (size_t i = 0; i < cameras.size(); ++i) {
    const Image depth = RenderSyntheticView(scene, cameras[i]).depth;
    Image photo(96, 72);
    float least = INFINITY, most = 0;
    for (const float z : depth.pixels)
      if (z > 0) least = std::min(least, 1 / z), most = std::max(most, 1 / z);
    for (size_t p = 0; p < photo.pixels.size(); ++p) {
      const float z = depth.pixels[p / 3];
      photo.pixels[p] = z > 0 ? (1 / z - least) / (most - least) : 0;
    }
    WritePng16(folder / Format("s/images/%05zu.png", i), photo);
  }
  testing::TinyOnnx network;
  network.Input("image", 3);
  testing::PixelConv(&network, "image", "depth", {1, 1, 1});
  network.Output("depth", 1);
  testing::WriteText(folder / "mean.onnx", network.Bytes());
  const auto reconstruct = [&](const std::string& out, const std::string& field,
                               const std::string& file) {
    return testing::Regrade(
        {"reconstruct", folder / "s", "--out", folder / out, "--device", "cpu", "--effects",
         "exposure=off,pose-refinement=off", "--depth-network", folder / file},
        testing::TinyFlags(field));
  };
  const testing::ProgramOutcome outcome = reconstruct("o", "splats", "mean.onnx");
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  const size_t said = outcome.text.find(" guessed depths where photos have no points");
  ASSERT_NE(said, std::string::npos) << outcome.text;
  EXPECT_GT(std::stoi(outcome.text.substr(outcome.text.rfind('\n', said) + 1)), 20);
  EXPECT_EQ(outcome.text.find("left out"), std::string::npos) << outcome.text;
  // They lie on the scene's surfaces, and away from the photo's points.
  const WorkingViews views = ReadWorkingViews(folder / "o/poses", 96, 0);
  const std::vector<int> of = {1, 4};
  std::vector<std::vector<SeenPoint>> seen = PointsSeenBy(views.capture(), of, {});
  std::vector<std::string> notes;
  const auto points = seen;
  AddGuessedDepths(folder / "mean.onnx", views, of, {}, &seen, &notes);
  for (size_t k = 0; k < of.size(); ++k) {
    const Camera& camera = cameras[static_cast<size_t>(of[k])];
    const Image truth = RenderSyntheticView(scene, camera).depth;
    int near = 0, added = 0;
    for (size_t i = points[k].size(); i < seen[k].size(); ++i, ++added) {
      double x, y, depth;
      ASSERT_TRUE(camera.Project(seen[k][i].position.Cast<double>(), &x, &y, &depth));
      const float z = *truth.at(std::clamp(static_cast<int>(x), 0, 95),
                                std::clamp(static_cast<int>(y), 0, 71));
      near += std::abs(depth / double{z} - 1) < 0.1;
    }
    EXPECT_GT(added, 3);
    EXPECT_GE(near, 0.8 * added);
  }
  // What continues the folder needs no network, and asks nothing.
  fs::rename(folder / "mean.onnx", folder / "moved.onnx");
  const testing::ProgramOutcome styled = testing::Regrade(
      {"stylize", folder / "o", "--style", testing::SourceDir() + "/assets/style_sunset.png",
       "--until", "stylize"});
  EXPECT_EQ(styled.code, 0) << styled.text;
  EXPECT_EQ(reconstruct("v", "voxels", "moved.onnx").code, static_cast<int>(ExitCode::kUsage));
  const testing::ProgramOutcome none = reconstruct("n", "splats", "none.onnx");
  EXPECT_EQ(none.code, static_cast<int>(ExitCode::kExternalProgram)) << none.text;
  EXPECT_SAYS(none, "none.onnx");
  EXPECT_FALSE(fs::exists(folder / "n"));
}

}  // namespace
}  // namespace regrade
