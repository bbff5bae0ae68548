// Several style pictures as one style, by runs of the program.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "pipeline/images/image_file.h"
#include "pipeline/workspace/style_folders.h"
#include "tests/support/nightly.h"
#include "tests/support/source_dir.h"
#include "tests/support/spawn.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"
#include "tests/support/two_regions.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::ProgramOutcome;
using testing::ReadText;
using testing::Regrade;
using testing::TemporaryFolder;

// The mean over the pixels where `mask` is 1, or all.
Vec3d MeanColor(const Image& image, const Image* mask) {
  Vec3d sum{};
  double count = 0;
  for (int64_t i = 0; i < image.num_pixels(); ++i) {
    if (mask != nullptr && mask->pixels[static_cast<size_t>(i)] < 1) continue;
    const float* p = &image.pixels[static_cast<size_t>(3 * i)];
    sum += Vec3d{p[0], p[1], p[2]};
    ++count;
  }
  return sum / count;
}

TEST(MatchedStyles, EachRegionTakesItsPictureAndTheStyleIsLikeAnyOther) {
  REGRADE_AT_NIGHT();
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 6, "96x72");
  const testing::TwoRegions scene = testing::SkyAndGround(6, 96, 72);
  for (int i = 0; i < 6; ++i)
    WritePng8(folder / Format("s/images/%05d.png", i), scene.photos[static_cast<size_t>(i)]);
  const std::vector<Image> styles = testing::SkyAndGroundStyles();
  const std::string sky = folder / "sky.png", wall = folder / "wall.png";
  WritePng8(sky, styles[0]);
  WritePng8(wall, styles[1]);
  std::vector<std::string> run{"run", folder / "s/truth", "--out", folder / "out"};
  for (const std::string& flag : testing::TinyFlags()) run.push_back(flag);
  run.insert(run.end(), {"--device", "cpu", "--style", sky, "--style", wall, "--match",
                         "regions", "--scene-wide"});
  ProgramOutcome outcome = Regrade(run);
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_SAYS(outcome, "% like sky.png");

  // One style, in every record, with a page.
  EXPECT_EQ(StyleNames(folder / "out"), std::vector<std::string>{"sky-wall"});
  const std::string style = folder / "out/styles/sky-wall";
  const std::string options = ReadText(style + "/run.json");
  for (const char* part : {"\"match\": \"regions\"", "sky.png", "wall.png"})
    EXPECT_NE(options.find(part), std::string::npos) << part;
  EXPECT_NE(ReadText(style + "/report.json").find("like wall.png"), std::string::npos);
  EXPECT_NE(ReadText(style + "/report.json").find("sliced_wasserstein_to_style"),
            std::string::npos);
  EXPECT_TRUE(fs::exists(style + "/scene.html"));

  // The regions' means are those of their pictures: what MKL moves exactly, but for pixels
  // beside the border that were measured with the other region.
  Vec3d seen[2]{};
  for (int i = 0; i < 6; ++i) {
    const Image picture = ReadImage(style + Format("/views_2d/%05d.png", i));
    const Image above =
        Resize(scene.sky[static_cast<size_t>(i)], picture.width, picture.height);
    Image ground = above;
    for (float& v : ground.pixels) v = v > 0 ? 0.0f : 1.0f;
    seen[0] += MeanColor(picture, &above) / 6.0;
    seen[1] += MeanColor(picture, &ground) / 6.0;
  }
  for (const size_t k : {0, 1}) {
    const Vec3d wanted = MeanColor(styles[k], nullptr);
    EXPECT_LE(Norm(seen[k] - wanted), 0.05) << k;
    EXPECT_GE(Norm(seen[1 - k] - wanted), 0.2) << k;
  }

  // Again, as a mixture, and on a sheet.
  testing::Said({"stylize", folder / "out", "--style", sky, "--style", wall, "--match",
                 "regions", "--scene-wide"});
  EXPECT_EQ(StyleNames(folder / "out").size(), 1u);
  outcome = Regrade({"render", folder / "out", "--until", "render"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  outcome = Regrade({"mix", folder / "out", "sky-wall", "--mix", "0.5", "--out", folder / "m"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  outcome = Regrade({"contact-sheet", folder / "out", "sky-wall", "--size", "64", "--views",
                     "1", "--out", folder / "c.png"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_TRUE(fs::exists(folder / "c.png"));

  // H189: pictures that look alike are refused, with the way out.
  Image other = styles[0];
  other.pixels[0] = 0;
  WritePng8(folder / "sky2.png", other);
  outcome = Regrade({"stylize", folder / "out", "--style", sky, "--style", folder / "sky2.png",
                     "--style", wall, "--match", "regions"});
  EXPECT_EQ(outcome.code, 3) << outcome.text;
  EXPECT_SAYS(outcome, "--style-mask");
  const auto refused = [&](std::vector<std::string> more) {
    return Regrade({"stylize", folder / "out"}, more).code;
  };
  EXPECT_EQ(refused({"--style", sky, "--match", "regions"}), 2);
  EXPECT_EQ(refused({"--style", sky, "--style", wall, "--match", "regions", "--masks",
                     folder / "s/images"}),
            2);
  EXPECT_EQ(refused({"--style", sky, "--style", wall, "--match", "colors"}), 2);
  EXPECT_EQ(refused({"--style", sky, "--style", wall, "--match", "regions:"}), 2);
}

TEST(StyleFolders, PicturesOfOneStyleAreNamedTogether) {
  const TemporaryFolder folder;
  for (const char* name : {"a.png", "b.png", "c.png"}) testing::WriteText(folder / name, name);
  const std::vector<std::string> both = {folder / "a.png", folder / "b.png"};
  const std::vector<NamedStyle> named = NameStyles(folder / "out", both, "", true);
  ASSERT_EQ(named.size(), 1u);
  EXPECT_EQ(named[0].name, "a-b");
  EXPECT_EQ(named[0].pictures, both);
  EXPECT_EQ(NameStyles(folder / "out", both, "mine", true)[0].name, "mine");
  EXPECT_NE(PicturesHash(both), PicturesHash({both[1], both[0]}));
  // Another pair has the name.
  testing::WriteText(
      folder / "out/styles/a-b/run.json",
      "{\"picture_hash\": \"" + PicturesHash({both[0], folder / "c.png"}) + "\"}");
  EXPECT_EQ(NameStyles(folder / "out", both, "", true)[0].name, "a-b-2");
}

}  // namespace
}  // namespace regrade
