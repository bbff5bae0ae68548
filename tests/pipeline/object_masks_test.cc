// Masks of photos, found by name; labels of regions; and an object's style over a whole run.
#include "pipeline/capture/object_masks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/source_dir.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

using testing::ProgramOutcome;
using testing::TemporaryFolder;

// Columns [from, to) of a picture in a colour, the rest black.
void WriteBands(const std::string& path, int width, int height,
                const std::vector<std::pair<Vec3f, std::pair<int, int>>>& bands) {
  Image image(width, height);
  for (const auto& [color, columns] : bands)
    for (int y = 0; y < height; ++y)
      for (int x = columns.first; x < columns.second; ++x)
        std::copy_n(&color.x, 3, image.at(x, y));
  WritePng8(path, image);
}

const Vec3f kWhite{1, 1, 1}, kRed{1, 0, 0}, kBlue{0, 0, 1};

TEST(ObjectMasks, FoundByNameAndBroughtToTheViewsSize) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "m");
  WriteBands(folder / "m/IMG_2.png", 40, 20, {{kWhite, {10, 20}}});
  MaskOptions options{.masks = folder / "m"};
  const ObjectMasks masks(options, {"IMG_1.jpg", "IMG_2.jpg"});
  EXPECT_EQ(masks.num_known(), 1);
  EXPECT_FALSE(masks.Knows(0));
  const std::vector<Image> coverage = masks.Coverage(1, 80, 40);
  ASSERT_EQ(coverage.size(), 1u);
  EXPECT_EQ(*coverage[0].at(30, 5), 1);
  EXPECT_EQ(*coverage[0].at(10, 5), 0);
  EXPECT_TRUE(masks.StyleRegion(0, 8, 8).empty());
  EXPECT_REGRADE_ERROR(masks.Coverage(1, 40, 40), ExitCode::kInput, "IMG_2.png");
  EXPECT_REGRADE_ERROR(ObjectMasks(options, {"a.jpg"}), ExitCode::kInput, "a.png");
}

TEST(ObjectMasks, H50_LabelsOfSeveralRegionsSumToAtMostOne) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "m");
  WriteBands(folder / "m/a.png", 40, 20, {{kRed, {0, 10}}, {kBlue, {10, 25}}});
  WriteBands(folder / "style.png", 60, 10, {{kBlue, {0, 30}}, {kRed, {30, 50}}});
  MaskOptions options{.masks = folder / "m", .style_mask = folder / "style.png"};
  const ObjectMasks masks(options, {"a.jpg"});
  ASSERT_EQ(masks.num_regions(), 2);  // blue comes first in the style
  const std::vector<Image> coverage = masks.Coverage(0, 20, 10);
  EXPECT_EQ(*coverage[0].at(8, 3), 1);  // blue
  EXPECT_EQ(*coverage[1].at(2, 3), 1);  // red
  EXPECT_EQ(*coverage[0].at(15, 3) + *coverage[1].at(15, 3), 0);
  for (size_t i = 0; i < coverage[0].pixels.size(); ++i)
    EXPECT_LE(coverage[0].pixels[i] + coverage[1].pixels[i], 1 + 1e-6f);
  EXPECT_EQ(*masks.StyleRegion(0, 60, 10).at(5, 5), 1);
  EXPECT_EQ(*masks.StyleRegion(1, 60, 10).at(5, 5), 0);
  WriteBands(folder / "style.png", 60, 10, {});
  EXPECT_REGRADE_ERROR(ObjectMasks(options, {"a.jpg"}), ExitCode::kInput, "entirely black");
}

// Mean of |a - b| over the pixels within 8 of the object, or farther.
double Change(const Image& a, const Image& b, const Image& mask, bool inside) {
  double sum = 0;
  int count = 0;
  for (int y = 0; y < a.height; ++y)
    for (int x = 0; x < a.width; ++x) {
      bool near = false;
      for (int v = std::max(0, y - 8); v <= std::min(a.height - 1, y + 8); ++v)
        for (int u = std::max(0, x - 8); u <= std::min(a.width - 1, x + 8); ++u)
          near |= *mask.at(u, v) > 0;
      if (near != inside) continue;
      for (int c = 0; c < 3; ++c) sum += std::abs(a.at(x, y)[c] - b.at(x, y)[c]);
      ++count;
    }
  return count > 0 ? sum / (3 * count) : 0;
}

TEST(ObjectMasks, H50_ARunWithWrongMasksRestylesTheObjectAlone) {
  const TemporaryFolder folder;
  const std::string style = testing::SourceDir() + "/assets/style_sunset.png";
  testing::Said(
      {"synth", folder / "s", "--views", "12", "--size", "96x72", "--effects", "masks"});
  testing::Said(
      testing::Joined({"run", folder / "s/truth", "--style", style, "--out", folder / "e",
                       "--masks", folder / "s/masks"},
                      testing::Words("--path views --photo-size 96 --field voxels --config "
                                     R"({"fit-resolutions":[32],"fit-steps":[200]})"
                                     " --style-steps 10 --threads 2 --tracks given")));
  // View 2 was given a mask beside the ball, view 3 an empty one, view 5 a swollen one.
  double restyled = 0, spilled = 0;
  for (const char* name : {"00001", "00002", "00003", "00005"}) {
    const auto frame = [&](const char* sequence) {
      return ReadImage(folder / (std::string("e/styles/style_sunset/frames/") + sequence + "/" +
                                 name + ".png"));
    };
    const Image truth = ReadImage(folder / (std::string("s/truth/masks/") + name + ".png"));
    restyled += Change(frame("source"), frame("styled"), truth, true);
    spilled += Change(frame("source"), frame("styled"), truth, false);
  }
  EXPECT_GT(restyled / 4, 0.01);  // the ball itself by a tenth, and half of what is near it
  // Haze of a field of 32 voxels a side carries a little of the ball away, and the two swollen
  // masks of ten have a vote: together a hundredth of the change was seen.
  EXPECT_LT(spilled, 0.02 * restyled);
  EXPECT_LT(spilled / 4, 0.5 / 255);  // nothing that 8 bits show, on the mean

  // Nobody has marked anything: the scene stays as it was, and that is said.
  std::filesystem::create_directories(folder / "none");
  for (int i = 0; i < 12; ++i) {
    char name[32];
    std::snprintf(name, sizeof name, "%05d.png", i);
    WritePng8(folder / ("none/" + std::string(name)), Image(96, 72, 1));
  }
  const ProgramOutcome empty =
      testing::Regrade({"stylize", folder / "e", "--masks", folder / "none"});
  ASSERT_EQ(empty.code, 0) << empty.text;
  EXPECT_SAYS(empty, "mask-vote");
  const auto pixels = [&](const char* path) { return ReadImage(folder / path).pixels; };
  EXPECT_EQ(pixels("e/styles/style_sunset/frames/styled/00001.png"),
            pixels("e/styles/style_sunset/frames/source/00001.png"));

  EXPECT_EQ(testing::Regrade({"stylize", folder / "e", "--masks", folder / "nowhere"}).code, 3);
  EXPECT_EQ(
      testing::Regrade({"stylize", folder / "e", "--masks", "", "--style-mask", style}).code,
      2);
}

}  // namespace
}  // namespace regrade
