// Masks of what moved, from the command line to the fit: a thing that stands somewhere else in
// every photo leaves no ghost.
#include <gtest/gtest.h>

#include <filesystem>

#include "evaluate/image_quality.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/workspace/output_names.h"
#include "tests/support/nightly.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::ReadText;
using testing::Said;
using testing::TemporaryFolder;

constexpr int kMaskedViews = 17, kWidth = 160, kHeight = 120, kThing = 60;

// A synthetic capture with its poses; in a copy of it a magenta square stands before all photos
// but the last, somewhere else in each, and masks have it.
void SynthWithAThing(const TemporaryFolder& folder) {
  Said({"synth", folder / "clean", "--views", std::to_string(kMaskedViews), "--size",
        "160x120"});
  fs::copy(folder / "clean", folder / "s", fs::copy_options::recursive);
  fs::create_directories(folder / "masks");
  for (int i = 0; i + 1 < kMaskedViews; ++i) {
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

void Reconstruct(const std::string& capture, const std::string& out, const std::string& steps,
                 std::vector<std::string> more) {
  Said(testing::Joined({"reconstruct", capture, "--out", out, "--tracks", "given", "--splats",
                        "4", "--splat-steps", steps},
                       more));
}

double HeldOutPsnr(const std::string& out) {
  return ReadJsonFile(out + "/.regrade/stages/reconstruct.json")
      .At("metrics")
      .At("psnr_heldout_db")
      .AsDouble();
}

TEST(PhotoMasks, MaskedPixelsAreNeitherFittedNorMeasured) {
  REGRADE_AT_NIGHT();
  const TemporaryFolder folder;
  SynthWithAThing(folder);
  Reconstruct(folder / "s/truth", folder / "with", "400", {"--photo-masks", folder / "masks"});
  Reconstruct(folder / "clean/truth", folder / "clean_out", "400", {});
  // A square of a quarter of the picture before fitted and held-out photos alike costs many
  // decibels where it is fitted or measured.
  EXPECT_GT(HeldOutPsnr(folder / "with"), HeldOutPsnr(folder / "clean_out") - 2);

  // Nor do 2D methods see it, which map a view by its own colours.
  for (const char* out : {"with", "clean_out"})
    Said({"stylize", folder / out, "--style", folder / "clean/images/00008.png",
          "--style-steps", "1", "--path", "views"});
  const Capture capture = ReadCapture(folder / "with/poses");
  for (const int i : {1, 6}) {
    const Image seen = ReadImage(folder / ("with/styles/00008/views_2d/" + FrameName(i)));
    const Image clean = ReadImage(folder / ("clean_out/styles/00008/views_2d/" + FrameName(i)));
    // Of the masked part alone.
    const Image kept = WorkingViews(capture, kWidth, 0).Mask(i);
    EXPECT_GT(Psnr(seen, clean, &kept).value(), 17) << FrameName(i);  // the square has 13
  }

  // Pixels that the mask's edge runs through are left out with it, and photos may have none.
  EXPECT_TRUE(
      WorkingViews(capture, 80, 0).Mask(static_cast<int>(capture.views.size()) - 1).empty());
  const Image kept = WorkingViews(capture, 80, 0).Mask(1);  // the square begins at 37, 23
  ASSERT_EQ(kept.width, 80);
  for (int x : {18, 19, 47, 48}) EXPECT_EQ(*kept.at(x, 20), 0) << x;
  for (int x : {17, 49}) EXPECT_EQ(*kept.at(x, 20), 1) << x;
  EXPECT_TRUE(ReadWorkingViews(folder / "clean_out/poses", 80, 0).Mask(1).empty());
}

TEST(PhotoMasks, LaterStagesAndRunsUseTheStagedMasks) {
  const TemporaryFolder folder;
  SynthWithAThing(folder);
  Reconstruct(folder / "s/truth", folder / "out", "60", {"--photo-masks", folder / "masks"});
  fs::remove_all(folder / "masks");
  // Whatever a 2D method made of the masked parts, the network that learns of it is the same,
  // and so are the figures against its pictures.
  const Capture capture = ReadCapture(folder / "out/poses");
  std::string networks[2];
  double psnr[2];
  for (int k = 0; k < 2; ++k) {
    const std::string styled = folder / ("styled" + std::to_string(k));
    fs::create_directories(styled);
    const WorkingViews views(capture, kWidth, 0);
    for (int i = 0; i < views.count(); ++i) {
      Image picture = views.Photo(i);
      const Image kept = views.Mask(i);
      for (int64_t p = 0; p < kept.num_pixels(); ++p)
        if (kept.pixels[p] < 0.5f)
          for (int c = 0; c < 3; ++c) picture.pixels[3 * p + c] = static_cast<float>(k);
      WritePng8(styled + "/" + views.View(i).name, picture);
    }
    const std::string out = folder / ("out" + std::to_string(k));
    fs::copy(folder / "out", out, fs::copy_options::recursive);
    Said({"stylize", out, "--style", folder / "s/images/00016.png", "--method",
          "folder:" + styled, "--style-steps", "4", "--path", "views"});
    networks[k] = ReadText(out + "/styles/00016/network.npz");
    psnr[k] = ReadJsonFile(out + "/styles/00016/report.json")
                  .At("stages")
                  .At("evaluate")
                  .At("psnr_to_2d_photos_db")
                  .AsDouble();
  }
  EXPECT_FALSE(networks[0].empty());
  EXPECT_TRUE(networks[0] == networks[1]);
  EXPECT_EQ(psnr[0], psnr[1]);
  // A run that starts from these poses has their masks.
  Said({"pose", folder / "out", "--out", folder / "again", "--tracks", "given"});
  EXPECT_FALSE(ReadWorkingViews(folder / "again/poses", kWidth, 0).Mask(1).empty());
}

TEST(PhotoMasks, AnEntirelyBlackMaskIsRefused) {
  const TemporaryFolder folder;
  SynthWithAThing(folder);
  WritePng8(folder / "masks/00003.png", Image(kWidth, kHeight, 1));
  const std::string output = Said({"pose", folder / "s/truth", "--out", folder / "out",
                                   "--tracks", "given", "--photo-masks", folder / "masks"},
                                  3);
  EXPECT_NE(output.find("00003.png"), std::string::npos) << output;
}

}  // namespace
}  // namespace regrade
