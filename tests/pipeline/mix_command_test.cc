// regrade mix, render --path and contact-sheet over a whole, tiny run: exact ends, and what
// they refuse.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/fields/field_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/page/keyframes.h"
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

// A scene whose colours know no direction has a style that does, and a film between the two.
TEST(MixCommand, AStyleMayKnowDirectionsThatItsSceneDoesNot) {
  const TemporaryFolder folder;
  const std::string style = testing::SourceDir() + "/assets/style_sunset.png";
  testing::WriteCapture(folder / "s", 6, "96x72");
  std::vector<std::string> run{
      "run",       folder / "s/truth",    "--style",     style, "--out", folder / "e",
      "--effects", "view-dependence=off", "--keep-field"};
  for (const std::string& flag : testing::TinyFlags("voxels")) run.push_back(flag);
  const ProgramOutcome done = Regrade(run);
  ASSERT_EQ(done.code, 0) << done.text;
  EXPECT_EQ(ReadFieldFile(folder / "e/field.npz").field.appearance.basis, 1);
  const Appearance styled =
      ReadFieldFile(folder / "e/styles/style_sunset/styled.npz").field.appearance;
  ASSERT_EQ(styled.basis, 9);
  float beyond = 0;
  for (int64_t i = 0; i < styled.sh.size(); ++i)
    if (i % 9 != 0) beyond = std::max(beyond, std::abs(styled.sh[i]));
  EXPECT_GT(beyond, 0);

  ASSERT_EQ(Regrade({"mix", folder / "e", "--mix", "0:0.5:1", "--out", folder / "m"}).code, 0);
  const auto frame = [&](const std::string& path) { return ReadText(folder / path); };
  EXPECT_EQ(frame("m/frames/00000.png"),
            frame("e/styles/style_sunset/frames/path_source/00000.png"));
  EXPECT_EQ(frame("m/frames/00002.png"),
            frame("e/styles/style_sunset/frames/path_styled/00002.png"));
  EXPECT_NE(frame("m/frames/00001.png"),
            frame("e/styles/style_sunset/frames/path_styled/00001.png"));
}

TEST(MixCommand, H49_AFilmBetweenTheSceneAndItsStyle) {
  const TemporaryFolder folder;
  const std::string style = testing::SourceDir() + "/assets/style_sunset.png";
  testing::WriteCapture(folder / "s", 6, "96x72");
  std::vector<std::string> run{"run",   folder / "s/truth", "--style",     style,
                               "--out", folder / "e",       "--keep-field"};
  for (const std::string& flag : testing::TinyFlags()) run.push_back(flag);
  const ProgramOutcome done = Regrade(run);
  ASSERT_EQ(done.code, 0) << done.text;

  const ProgramOutcome mixed =
      Regrade({"mix", folder / "e", "--mix", "0:0.5:1", "--out", folder / "m"});
  ASSERT_EQ(mixed.code, 0) << mixed.text;
  const auto frame = [&](const std::string& path) { return ReadText(folder / path); };
  EXPECT_EQ(frame("m/frames/00000.png"),
            frame("e/styles/style_sunset/frames/path_source/00000.png"));
  EXPECT_EQ(frame("m/frames/00002.png"),
            frame("e/styles/style_sunset/frames/path_styled/00002.png"));
  EXPECT_NE(frame("m/frames/00001.png"),
            frame("e/styles/style_sunset/frames/path_source/00001.png"));
  EXPECT_NE(frame("m/frames/00001.png"),
            frame("e/styles/style_sunset/frames/path_styled/00001.png"));

  // The field at the end is the style's file, and the folder of a mix may be used again.
  ASSERT_EQ(Regrade({"mix", folder / "e", "--mix", "1", "--out", folder / "m"}).code, 0);
  EXPECT_EQ(frame("m/mixed.npz"), frame("e/styles/style_sunset/styled.npz"));

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
  EXPECT_NE(walked.text.find("3 frames of 32x24"), std::string::npos) << walked.text;
  const std::string film = frame("e/films/walk_1.mp4");
  EXPECT_GT(film.size(), 1000u);
  ASSERT_EQ(Regrade(render).code, 0);
  EXPECT_EQ(frame("e/films/walk_1.mp4"), film);  // the same bytes again
  keyframes[1]["weights"] = JsonValue::Array{0, 1};
  path["keyframes"] = keyframes;
  WriteJsonFile(folder / "walk.json", path);
  const ProgramOutcome unknown =
      Regrade({"render", folder / "e", "--path", folder / "walk.json"});
  EXPECT_EQ(unknown.code, 3);
  EXPECT_NE(unknown.text.find("style 2 of this camera path"), std::string::npos)
      << unknown.text;
  EXPECT_FALSE(std::filesystem::exists(folder / "e/films/walk.mp4"));

  ProgramOutcome refused =
      Regrade({"mix", folder / "e", "--mix", "0:1.5", "--out", folder / "x"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.text.find("not between 0 and 1"), std::string::npos) << refused.text;
  refused = Regrade({"mix", folder / "e", folder / "none.npz", "--out", folder / "x"});
  EXPECT_EQ(refused.code, 3);
  EXPECT_NE(refused.text.find("none.npz"), std::string::npos) << refused.text;
  EXPECT_EQ(Regrade({"mix", folder / "e", "--out", folder / "s"}).code, 2);  // not empty
  EXPECT_EQ(Regrade({"mix", folder / "e"}).code, 2);                         // no --out
  EXPECT_EQ(Regrade({"mix", folder / "e", "--dry-run"}).code, 0);
  EXPECT_FALSE(std::filesystem::exists(folder / "x"));

  EXPECT_EQ(Regrade({"contact-sheet", folder / "e", "--out", folder / "y.png"}).code, 0);
  EXPECT_GT(frame("y.png").size(), 10000u);
  EXPECT_EQ(Regrade({"contact-sheet", folder / "e", "none", "--out", folder / "y"}).code, 3);
}

}  // namespace
}  // namespace regrade
