// Depths that a network guesses: their scale and shift, and where they become points. The
// network of these tests is the mean of a photo's channels.
#include "pipeline/capture/guessed_depths.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "kernels/synthetic/ray_trace.h"
#include "kernels/synthetic/synthetic_scene.h"
#include "pipeline/images/image_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/spawn.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_onnx.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

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
        {"reconstruct", folder / "s", "--out", folder / out, "--device", "cpu",
         "--effects", "exposure=off,pose-refinement=off", "--depth-network", folder / file},
        testing::TinyFlags(field));
  };
  const testing::ProgramOutcome outcome = reconstruct("o", "splats", "mean.onnx");
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_SAYS(outcome, "guessed depths where photos have no points");
  EXPECT_EQ(outcome.text.find("left out"), std::string::npos) << outcome.text;
  EXPECT_EQ(outcome.text.find(" 0 guessed"), std::string::npos) << outcome.text;
  EXPECT_EQ(reconstruct("v", "voxels", "mean.onnx").code, static_cast<int>(ExitCode::kUsage));
  EXPECT_NE(reconstruct("n", "splats", "none.onnx").code, 0);
}

}  // namespace
}  // namespace regrade
