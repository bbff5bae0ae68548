// Masks of what moved, from the command line to the fit: a thing that stands somewhere else in
// every photo leaves no ghost.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>

#include "kernels/base/child_process.h"
#include "pipeline/files/image_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/scene_views.h"
#include "pipeline/capture_store.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::TemporaryFolder;

constexpr int kViews = 17, kWidth = 160, kHeight = 120, kThing = 60, kHoldout = 8;

// What it said; it has to end with `exit_code`.
std::string Regrade(std::vector<std::string> arguments, int exit_code = 0) {
  ChildOptions options;
  options.argv = {REGRADE_PROGRAM};
  options.argv.insert(options.argv.end(), arguments.begin(), arguments.end());
  options.wall_limit_s = 240;
  std::string said;
  const ChildResult result =
      RunChild(options, [&said](const std::string& line) { said += line + "\n"; });
  EXPECT_EQ(result.exit_status, exit_code) << said;
  return said;
}

// A synthetic capture with its poses, and a magenta square before every photo that is fitted;
// masks of it, which photos without the square lack.
void SynthWithAThing(const TemporaryFolder& folder) {
  Regrade({"synth", folder / "s", "--views", std::to_string(kViews), "--size", "160x120"});
  fs::create_directories(folder / "masks");
  for (int i = 0; i < kViews; ++i) {
    if (i % kHoldout == 0) continue;
    const std::string name = FrameName(i);
    Image photo = ReadImage(folder / ("s/images/" + name)), mask(kWidth, kHeight, 1);
    for (float& value : mask.pixels) value = 1;
    const int left = 37 * i % (kWidth - kThing), top = 23 * i % (kHeight - kThing);
    for (int y = top; y < top + kThing; ++y)
      for (int x = left; x < left + kThing; ++x) {
        photo.at(x, y)[0] = photo.at(x, y)[2] = 1;
        photo.at(x, y)[1] = 0;
        *mask.at(x, y) = 0;
      }
    WritePng8(folder / ("s/images/" + name), photo);
    WritePng8(folder / ("masks/" + name), mask);
  }
}

double HeldOutPsnr(const std::string& out) {
  return ReadJsonFile(out + "/.regrade/stages/reconstruct.json")
      .At("figures")
      .At("psnr_heldout_db")
      .AsDouble();
}

TEST(PhotoMasks, WhatTheyBlackenIsNotFitted) {
  const TemporaryFolder folder;
  SynthWithAThing(folder);
  const auto reconstruct = [&](const std::string& out, std::vector<std::string> more) {
    std::vector<std::string> words = {"reconstruct", folder / "s/truth", "--out", out,
                                      "--tracks", "given", "--fit-resolutions", "24,48",
                                      "--fit-steps", "100,200", "--fit-rays", "2048"};
    words.insert(words.end(), more.begin(), more.end());
    Regrade(words);
  };
  reconstruct(folder / "with", {"--photo-masks", folder / "masks"});
  reconstruct(folder / "without", {});
  // A square of a quarter of the picture, somewhere else in each photo, is a fog of its colour.
  EXPECT_GT(HeldOutPsnr(folder / "with"), HeldOutPsnr(folder / "without") + 3);

  // Pixels that the mask's edge runs through are left out with it, and photos may have none.
  const Capture capture = ReadCapture(folder / "with/poses");
  EXPECT_TRUE(ReadWorkingMask(capture.views[0], 80).empty());
  const Image kept = ReadWorkingMask(capture.views[1], 80);  // the square begins at 37, 23
  ASSERT_EQ(kept.width, 80);
  for (int x : {18, 19, 47, 48}) EXPECT_EQ(*kept.at(x, 20), 0) << x;
  for (int x : {17, 49}) EXPECT_EQ(*kept.at(x, 20), 1) << x;
  EXPECT_TRUE(ReadWorkingMask(ReadCapture(folder / "without/poses").views[1], 80).empty());

  // What follows knows of them, wherever they have gone since.
  fs::remove_all(folder / "masks");
  Regrade({"stylize", folder / "with", "--style", folder / "s/images/00000.png",
           "--style-steps", "2", "--path", "views"});
}

TEST(PhotoMasks, OneThatLeavesNothingIsRefused) {
  const TemporaryFolder folder;
  SynthWithAThing(folder);
  WritePng8(folder / "masks/00003.png", Image(kWidth, kHeight, 1));
  const std::string said =
      Regrade({"pose", folder / "s/truth", "--out", folder / "out", "--tracks", "given",
               "--photo-masks", folder / "masks"},
              3);
  EXPECT_NE(said.find("00003.png"), std::string::npos) << said;
}

}  // namespace
}  // namespace regrade
