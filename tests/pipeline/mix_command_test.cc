// regrade mix, render --path and contact-sheet over a whole, tiny run: exact ends, and what
// they refuse.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/fields/field_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/page/keyframes.h"
#include "pipeline/stages/styled_field.h"
#include "tests/support/keyframes.h"
#include "tests/support/source_dir.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

using testing::ProgramOutcome;
using testing::ReadText;
using testing::Regrade;
using testing::TemporaryFolder;

// A film from the scene in folder / "e" to its style, in folder / "m".
void ExpectExactEnds(const TemporaryFolder& folder) {
  testing::Said({"mix", folder / "e", "--mix", "0:0.5:1", "--out", folder / "m"});
  const auto mixed = [&](const std::string& name) {
    return ReadText(folder / ("m/frames/" + name));
  };
  const auto frame = [&](const std::string& path) {
    return ReadText(folder / ("e/styles/style_sunset/frames/" + path));
  };
  EXPECT_EQ(mixed("00000.png"), frame("path_source/00000.png"));
  EXPECT_EQ(mixed("00002.png"), frame("path_styled/00002.png"));
  EXPECT_NE(mixed("00001.png"), frame("path_source/00001.png"));
  EXPECT_NE(mixed("00001.png"), frame("path_styled/00001.png"));
}

// A scene whose colours know no direction has a style that does, and a film between the two.
TEST(MixCommand, AStyleMayKnowDirectionsThatItsSceneDoesNot) {
  const TemporaryFolder folder;
  const std::string style = testing::SourceDir() + "/assets/style_sunset.png";
  testing::WriteCapture(folder / "s", 6, "96x72");
  testing::Said(testing::Joined({"run", folder / "s/truth", "--style", style, "--out",
                                 folder / "e", "--effects", "view-dependence=off"},
                                testing::TinyFlags("voxels")));
  EXPECT_EQ(ReadFieldFile(folder / "e/field.npz").field.appearance.basis, 1);
  const Appearance styled =
      ReadStyledField(folder / "e", folder / "e/styles/style_sunset").field.appearance;
  ASSERT_EQ(styled.basis, 9);
  float beyond = 0;
  for (int64_t i = 0; i < styled.sh.size(); ++i)
    if (i % 9 != 0) beyond = std::max(beyond, std::abs(styled.sh[i]));
  EXPECT_GT(beyond, 0);

  ExpectExactEnds(folder);
}

TEST(MixCommand, H49_AFilmBetweenTheSceneAndItsStyle) {
  const TemporaryFolder folder;
  const std::string style = testing::SourceDir() + "/assets/style_sunset.png";
  testing::WriteCapture(folder / "s", 6, "96x72");
  testing::Said(
      testing::Joined({"run", folder / "s/truth", "--style", style, "--out", folder / "e"},
                      testing::TinyFlags()));

  ExpectExactEnds(folder);

  // The field at the end is the style's file, and the folder of a mix may be used again.
  ASSERT_EQ(Regrade({"mix", folder / "e", "--mix", "1", "--out", folder / "m"}).code, 0);
  WriteFieldFile(folder / "styled.npz",
                 ReadStyledField(folder / "e", folder / "e/styles/style_sunset"));
  EXPECT_EQ(ReadText(folder / "m/mixed.npz"), ReadText(folder / "styled.npz"));

  // The film of a page's path from the scene to its style.
  const std::string id = PageStyleId(folder / "e/styles/style_sunset");
  JsonValue path = testing::SomeKeyframes();
  path["styles"] = JsonValue::Array{id, "unknown"};
  JsonValue::Array keyframes = path.At("keyframes").AsArray();
  keyframes.resize(2);
  keyframes[1]["time"] = 0.125;
  path["keyframes"] = keyframes;
  WriteJsonFile(folder / "walk 1.json", path);
  const std::vector<std::string> render{
      "render", folder / "e", "--path", folder / "walk 1.json", "--film-size", "33"};
  const ProgramOutcome walked = Regrade(render);
  ASSERT_EQ(walked.code, 0) << walked.text;
  EXPECT_SAYS(walked, "3 frames of 32x24");
  const std::string film = ReadText(folder / "e/films/walk_1.mp4");
  EXPECT_GT(film.size(), 1000u);
  ASSERT_EQ(Regrade(render).code, 0);
  EXPECT_EQ(ReadText(folder / "e/films/walk_1.mp4"), film);  // the same bytes again
  keyframes[1]["weights"] = JsonValue::Array{0, 1};
  path["keyframes"] = keyframes;
  WriteJsonFile(folder / "walk.json", path);
  const ProgramOutcome unknown =
      Regrade({"render", folder / "e", "--path", folder / "walk.json"});
  EXPECT_EQ(unknown.code, 3);
  EXPECT_SAYS(unknown, "style 2 of this camera path");
  EXPECT_FALSE(std::filesystem::exists(folder / "e/films/walk.mp4"));

  ProgramOutcome refused =
      Regrade({"mix", folder / "e", "--mix", "0:1.5", "--out", folder / "x"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_SAYS(refused, "not between 0 and 1");
  refused = Regrade({"mix", folder / "e", folder / "none.npz", "--out", folder / "x"});
  EXPECT_EQ(refused.code, 3);
  EXPECT_SAYS(refused, "none.npz");
  EXPECT_EQ(Regrade({"mix", folder / "e", "--out", folder / "s"}).code, 2);  // not empty
  EXPECT_EQ(Regrade({"mix", folder / "e"}).code, 2);                         // no --out
  EXPECT_EQ(Regrade({"mix", folder / "e", "--dry-run"}).code, 0);
  EXPECT_FALSE(std::filesystem::exists(folder / "x"));

  EXPECT_EQ(Regrade({"contact-sheet", folder / "e", "--out", folder / "y.png"}).code, 0);
  EXPECT_GT(ReadText(folder / "y.png").size(), 10000u);
  EXPECT_EQ(Regrade({"contact-sheet", folder / "e", "none", "--out", folder / "y"}).code, 3);
}

}  // namespace
}  // namespace regrade
