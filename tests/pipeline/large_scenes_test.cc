// What large scenes need: parts of a film, and styles and pages of some of the splats.
#include <gtest/gtest.h>

#include <filesystem>
#include <set>

#include "pipeline/images/image_file.h"
#include "pipeline/page/make_page.h"
#include "pipeline/run/plan.h"
#include "pipeline/stages/trained_views.h"
#include "tests/support/pinhole.h"
#include "tests/support/source_dir.h"
#include "tests/support/spawn.h"
#include "tests/support/splat_ball.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::TemporaryFolder;

// A run of folder / "s" in one style, to folder / "e".
std::vector<std::string> Tiny(const TemporaryFolder& folder,
                              const std::vector<std::string>& more) {
  return testing::Joined(
      testing::Joined({"run", folder / "s/truth", "--out", folder / "e", "--device", "cpu",
                       "--style", testing::SourceDir() + "/assets/style_sunset.png"},
                      testing::TinyFlags()),
      more);
}

// With the layer of an edited photo.
TEST(Parts, OfARetouchedSceneAreTheSameBytes) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 6, "96x72");
  testing::Said(Tiny(folder, {"--until", "stylize"}));
  Image edited = ReadImage(folder / "s/images/00001.png");
  for (int y = 0; y < edited.height; ++y)
    for (int i = 0; i < 3 * edited.width / 2; ++i) edited.at(0, y)[i] *= 0.3f;
  WritePng8(folder / "edited.png", edited);
  testing::Said({"retouch", folder / "e", "--photo", "00001", "--edited", folder / "edited.png",
                 "--name", "half", "--until", "render"});
  const std::string style = folder / "e/styles/half";
  ASSERT_TRUE(fs::exists(style + "/layers"));
  const auto whole = testing::ResultsOf(style);
  fs::remove_all(style + "/frames");
  for (const char* film : {"styled.mp4", "source_vs_styled.mp4", "views_2d.mp4"})
    ASSERT_TRUE(fs::remove(style + "/" + film)) << film;
  testing::Said({"render", folder / "e", "--name", "half", "--part", "1/2"});
  // Each unit from what it sees of the field.
  testing::Said(
      {"render", folder / "e", "--name", "half", "--part", "2/2", "--max-memory", "0.01"});
  testing::Said(
      {"render", folder / "e", "--name", "half", "--part", "join", "--until", "render"});
  EXPECT_EQ(testing::ResultsOf(style), whole);
}

TEST(TrainedViews, AreAsManyAsFitEvenlyAmongAll) {
  const RadianceField ball = testing::SplatBall(4000);
  std::vector<Camera> cameras(8, testing::PinholeOf(20, 20, 100));
  for (int i = 0; i < 8; ++i)  // each sees a stripe of its own
    cameras[static_cast<size_t>(i)].camera_from_world.translation = {0.7 - 0.2 * i, 0, 3};
  size_t before = 1;
  std::set<size_t> sizes;
  const uint64_t least = static_cast<uint64_t>(kProgramBytes);
  for (uint64_t memory = least; memory < least + 3'000'000; memory += 5000) {
    const std::vector<int> within = CamerasWithin(memory, ball, cameras);
    EXPECT_GE(within.size(), before);
    before = within.size();
    sizes.insert(before);
    if (before == 2) {
      EXPECT_EQ(within, (std::vector<int>{0, 4}));
    }
    if (before == 4) {
      EXPECT_EQ(within, (std::vector<int>{0, 2, 4, 6}));
    }
  }
  EXPECT_EQ(sizes, (std::set<size_t>{1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_EQ(CamerasWithin(0, ball, cameras), std::vector<int>{0});
}

TEST(TrainedViews, AreAllWithoutALimitAndOfVoxelsAndObjects) {
  RunSettings settings;
  EXPECT_FALSE(IsTrainedOnAPart(settings, 100'000'000));
  settings.run.max_memory_gb = 1;
  EXPECT_TRUE(IsTrainedOnAPart(settings, 2'000'000));
  EXPECT_FALSE(IsTrainedOnAPart(settings, 1'000'000));
  settings.run.max_memory_gb = 0.01;
  EXPECT_FALSE(IsTrainedOnAPart(settings, 0));
  settings.object.masks = "masks";
  EXPECT_FALSE(IsTrainedOnAPart(settings, 2'000'000));
}

TEST(Page, OfAFieldThatIsTooLargeHasWhatPhotosShowMost) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 6, "96x72");
  testing::Said(Tiny(folder, {"--no-films", "--until", "stylize"}));
  const auto page = [&](int64_t most_bytes) {
    return MakePage(folder / "e", {"style_sunset"}, {.most_bytes = most_bytes}, {});
  };
  const MadePage whole = page(0), roomy = page(whole.bytes), tight = page(whole.bytes - 5000);
  EXPECT_EQ(roomy.html, whole.html);
  EXPECT_LE(std::ssize(tight.html), whole.bytes - 5000);
  EXPECT_GT(std::ssize(tight.html), whole.bytes - 20000);
  EXPECT_LT(tight.splats, whole.splats);
  EXPECT_GT(tight.report.size(), whole.report.size());
  const MadePage none = page(1000);
  EXPECT_TRUE(none.html.empty());
  EXPECT_GT(none.bytes, 1000);
}

}  // namespace
}  // namespace regrade
