// Styles of one scene, each in its own folder: nothing overwritten, the styled field remade
// from field and network, strength, and kills in the midst.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>

#include "pipeline/fields/field_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/stages/object_edit.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/style_folders.h"
#include "tests/support/expect_error.h"
#include "tests/support/nightly.h"
#include "tests/support/source_dir.h"
#include "tests/support/spawn.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::ProgramOutcome;
using testing::ReadText;
using testing::Regrade;
using testing::TemporaryFolder;
using testing::WriteText;

std::string Asset(const std::string& name) {
  return testing::SourceDir() + "/assets/style_" + name + ".png";
}

void Synth(const TemporaryFolder& folder, const std::vector<std::string>& more = {}) {
  ASSERT_EQ(Regrade({"synth", folder / "s", "--views", "6", "--size", "96x72"}, more).code, 0);
}

// A tiny run of folder / "s" with the given flags, its results in `out`.
std::vector<std::string> RunOf(const TemporaryFolder& folder, const std::string& out,
                               const std::vector<std::string>& more,
                               const std::string& field = "splats") {
  return testing::Joined(
      testing::Joined({"run", folder / "s/truth", "--out", folder / out, "--device", "cpu"},
                      testing::TinyFlags(field)),
      more);
}

TEST(Styles, EachHasItsFolderAndNothingIsOverwritten) {
  const TemporaryFolder folder;
  Synth(folder);
  ProgramOutcome done =
      Regrade(RunOf(folder, "e", {"--style", Asset("sunset"), "--style", Asset("night")}));
  ASSERT_EQ(done.code, 0) << done.text;
  const auto before = testing::ResultsOf(folder / "e/styles");
  for (const char* style : {"style_sunset", "style_night"})
    for (const char* file : {"styled.mp4", "network.npz", "report.html", "report.json",
                             "frames/styled/00000.png", "run.json"})
      EXPECT_TRUE(fs::exists(folder / (std::string("e/styles/") + style + "/" + file))) << file;
  EXPECT_EQ(ReadText(folder / "e/styled.mp4"),
            ReadText(folder / "e/styles/style_night/styled.mp4"));

  // Another picture of the same name, and a further one, on the same field.
  fs::create_directories(folder / "other");
  fs::copy_file(Asset("autumn"), folder / "other/style_night.png");
  const std::string field = ReadText(folder / "e/field.npz");
  done = Regrade({"stylize", folder / "e", "--style", folder / "other/style_night.png"});
  ASSERT_EQ(done.code, 0) << done.text;
  EXPECT_EQ(ReadText(folder / "e/field.npz"), field);
  for (const auto& [name, bytes] : before)
    EXPECT_TRUE(ReadText(folder / ("e/styles/" + name)) == bytes) << name;
  EXPECT_EQ(ReadText(folder / "e/styled.mp4"),
            ReadText(folder / "e/styles/style_night-2/styled.mp4"));
  EXPECT_EQ(StyleNames(folder / "e"),
            (std::vector<std::string>{"style_night", "style_night-2", "style_sunset"}));

  // mix and contact-sheet take the names.
  done = Regrade({"mix", folder / "e", "style_night", "style_sunset", "--mix", "1,0:0,1",
                  "--out", folder / "m"});
  ASSERT_EQ(done.code, 0) << done.text;
  const auto frame = [&](const std::string& path) { return ReadText(folder / path); };
  EXPECT_TRUE(frame("m/frames/00000.png") ==
              frame("e/styles/style_night/frames/path_styled/00000.png"));
  EXPECT_TRUE(frame("m/frames/00002.png") ==
              frame("e/styles/style_sunset/frames/path_styled/00002.png"));
  done = Regrade({"contact-sheet", folder / "e", "--size", "64", "--views", "2", "--out",
                  folder / "sheet.png"});
  ASSERT_EQ(done.code, 0) << done.text;
  EXPECT_GE(ReadImage(folder / "sheet.png").width, 4 * 64);  // photo and three styles
  // A style that was begun and not finished is left out, or refused by its name.
  fs::create_directories(folder / "e/styles/begun");
  fs::copy_file(folder / "e/styles/style_night/run.json", folder / "e/styles/begun/run.json");
  fs::remove(folder / "e/.regrade/last_style.json");
  EXPECT_EQ(LearnedStyles(folder / "e").size(), 3u);
  done = Regrade({"contact-sheet", folder / "e", "--size", "64", "--views", "1", "--out",
                  folder / "again.png"});
  ASSERT_EQ(done.code, 0) << done.text;
  EXPECT_EQ(ReadImage(folder / "again.png").width, ReadImage(folder / "sheet.png").width);
  for (const std::vector<std::string>& shown :
       {std::vector<std::string>{"contact-sheet", folder / "e", "begun", "--out", folder / "x"},
        {"mix", folder / "e", "begun", "--out", folder / "x"},
        {"render", folder / "e", "--name", "begun", "--photo", "00001"},
        {"export", folder / "e", "--format", "cube", "--name", "begun", "--out", folder / "x"}})
    EXPECT_EQ(Regrade(shown).code, 3) << shown[0];
  testing::Said({"export", folder / "e", "--format", "ply", "--out", folder / "y"});
  fs::remove_all(folder / "e/styles/begun");
  done = Regrade({"render", folder / "e", "--name", "none"});
  EXPECT_EQ(done.code, 3);
  EXPECT_SAYS(done, "style_night, style_night-2, style_sunset");
}

// field.npz of a style.
std::string StyledFile(const TemporaryFolder& folder, const std::string& style) {
  WriteFieldFile(folder / "styled.npz",
                 ReadStyledField(folder / "e", folder / ("e/styles/" + style)));
  return ReadText(folder / "styled.npz");
}

TEST(Styles, StrengthIsAMixOfSceneAndStyle) {
  const TemporaryFolder folder;
  Synth(folder);
  ProgramOutcome done =
      Regrade(RunOf(folder, "e", {"--style", Asset("sunset"), "--name", "s"}));
  ASSERT_EQ(done.code, 0) << done.text;
  const std::string network = ReadText(folder / "e/styles/s/network.npz"),
                    whole = StyledFile(folder, "s");
  for (const char* strength : {"0.5", "0"}) {
    done = Regrade({"stylize", folder / "e", "--name", "s", "--style", Asset("sunset"),
                    "--strength", strength});
    ASSERT_EQ(done.code, 0) << done.text;
    EXPECT_SAYS(done, "stylize: done before");
    EXPECT_TRUE(ReadText(folder / "e/styles/s/network.npz") == network);
    const JsonValue run = ReadJsonFile(folder / "e/styles/s/run.json");
    EXPECT_EQ(run.At("options").At("strength").AsDouble(), std::stod(strength));
    EXPECT_EQ(ReadJsonFile(folder / "e/styles/s/report.json")
                  .At("stages")
                  .At("render")
                  .At("strength")
                  .AsDouble(),
              std::stod(strength));
    if (std::string(strength) != "0") {
      // As `regrade mix` makes it.
      WriteText(folder / "whole.npz", whole);
      testing::Said({"mix", folder / "e", folder / "whole.npz", "--mix", strength, "--out",
                     folder / "m"});
      EXPECT_FALSE(StyledFile(folder, "s") == whole);
      const StoredField a = ReadFieldFile(folder / "styled.npz"),
                        b = ReadFieldFile(folder / "m/mixed.npz");
      // The style is rounded to half precision before the mix in one, after it in the other:
      // values below 8 differ by at most 2^-9.
      float worst = 0;
      for (int64_t i = 0; i < a.field.appearance.sh.size(); ++i)
        worst = std::max(worst, std::abs(a.field.appearance.sh[i] - b.field.appearance.sh[i]));
      EXPECT_LT(worst, 1.0f / 512);
    }
  }
  // Nothing of the style is left: renders, and what they are compared with.
  for (const char* sequence : {"styled", "views_2d"})
    EXPECT_EQ(ReadImage(folder / (std::string("e/styles/s/frames/") + sequence + "/00001.png"))
                  .pixels,
              ReadImage(folder / "e/styles/s/frames/source/00001.png").pixels)
        << sequence;
  EXPECT_EQ(Regrade({"stylize", folder / "e", "--name", "s", "--strength", "1.5"}).code, 2);
  // By its name a style goes on with its own options.
  EXPECT_SAYS(Regrade({"stylize", folder / "e", "--name", "s"}), "render: done before");
}

// Starts the run three times and kills it each time, within the second and the third style;
// false if it ended before it was killed.
bool KillWithinStyles(const TemporaryFolder& folder, const std::vector<std::string>& run) {
  const int null = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  bool killed = true;
  for (const char* when :
       {"styles/style_night/views_2d/00002.png", "styles/style_night/frames/styled/00001.png",
        "styles/style_autumn/network.npz"})
    killed =
        killed && testing::Spawn(REGRADE_PROGRAM, run, null, SIGKILL,
                                 folder / ("killed/" + std::string(when))) == 128 + SIGKILL;
  ::close(null);
  return killed;
}

// Three styles on one run, killed within the second and the third, and gone on.
TEST(Styles, KilledInTheMidstAndGoneOnIsByteIdentical) {
  REGRADE_AT_NIGHT();  // by day, scripts kill runs of one style
  const TemporaryFolder folder;
  Synth(folder);
  const std::vector<std::string> styles{"--style",       Asset("sunset"), "--style",
                                        Asset("night"),  "--style",       Asset("autumn"),
                                        "--reproducible"};
  ASSERT_EQ(Regrade(RunOf(folder, "whole", styles)).code, 0);
  // A signal may come too late on a busy machine; a run that ended before it was not killed.
  bool killed = false;
  for (int attempt = 0; attempt < 3 && !killed; ++attempt) {
    fs::remove_all(folder / "killed");
    killed = KillWithinStyles(folder, RunOf(folder, "killed", styles));
  }
  ASSERT_TRUE(killed);
  EXPECT_FALSE(fs::exists(folder / "killed/styles/style_autumn/report.html"));
  testing::Said(RunOf(folder, "killed", styles));
  const auto expected = testing::ResultsOf(folder / "whole"),
             now = testing::ResultsOf(folder / "killed");
  EXPECT_EQ(now.size(), expected.size());
  EXPECT_EQ(expected.count("styled.mp4"), 1u);
  for (const auto& [name, bytes] : expected)
    EXPECT_TRUE(now.count(name) == 1 && now.at(name) == bytes) << name;
}

TEST(Styles, FoldersOfAnOlderSchemaAreRefusedWithItsNumber) {
  const TemporaryFolder folder;
  Synth(folder);
  WriteText(folder / "old/.regrade/stages/pose.json",
            "{\"schema\": 2, \"regrade\": \"0.1.0\", \"inputs\": {}, \"outputs\": [], "
            "\"seconds\": 1, \"metrics\": {}}");
  WriteText(folder / "old/run.json",
            "{\"schema\": 1, \"arguments\": [], \"options\": {\"style\": \"a.png\"}}");
  ProgramOutcome refused = Regrade(RunOf(folder, "old", {"--style", Asset("sunset")}));
  EXPECT_EQ(refused.code, 3);
  EXPECT_SAYS(refused, "schema 2");
  EXPECT_SAYS(refused, "--out");
  for (const char* command : {"render", "stylize"}) {
    refused = Regrade({command, folder / "old", "--style", Asset("sunset")});
    EXPECT_EQ(refused.code, 2);
    EXPECT_SAYS(refused, "schema 1");
    EXPECT_SAYS(refused, "--out");
  }
}

// A photo's GPS position and a camera's serial number stay in the photo.
TEST(Styles, NothingOfThePhotosMetadataLeaves) {
  const TemporaryFolder folder;
  Synth(folder);
  const std::string secrets[] = {"SN-4711-SECRET", "Secret Lane"};
  for (const auto& entry : fs::directory_iterator(folder / "s/images")) {
    // A text chunk and trailing bytes, as cameras write them.
    std::string png = ReadText(entry.path().string());
    const std::string text = "Comment" + std::string(1, '\0') + secrets[0] + " " + secrets[1];
    std::string chunk = "tEXt" + text;
    uint32_t crc = 0xffffffffu;
    for (const char c : chunk) {
      crc ^= static_cast<unsigned char>(c);
      for (int k = 0; k < 8; ++k) crc = crc & 1 ? 0xedb88320u ^ crc >> 1 : crc >> 1;
    }
    crc = ~crc;
    const auto big = [](uint32_t v) {
      return std::string{static_cast<char>(v >> 24), static_cast<char>(v >> 16),
                         static_cast<char>(v >> 8), static_cast<char>(v)};
    };
    png.insert(33, big(static_cast<uint32_t>(text.size())) + chunk + big(crc));
    WriteText(entry.path().string(), png);
  }
  testing::Said(RunOf(folder, "e", {"--style", Asset("sunset")}));
  for (const char* format : {"png", "jpeg", "tiff"})
    testing::Said({"render", folder / "e", "--photo", "00001", "--format", format});
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder / "e/styles")) {
    if (!entry.is_regular_file()) continue;
    const std::string bytes = ReadText(entry.path().string());
    ++files;
    for (const std::string& secret : secrets)
      EXPECT_EQ(bytes.find(secret), std::string::npos) << entry.path();
  }
  EXPECT_GT(files, 20);
}

TEST(Stills, HaveThePhotosSizeAndASrgbTag) {
  const TemporaryFolder folder;
  Synth(folder);
  testing::Said(RunOf(folder, "e", {"--style", Asset("sunset")}));
  for (const char* format : {"png", "jpeg", "tiff"})
    testing::Said({"render", folder / "e", "--photo", "00001", "--format", format});
  const std::string stills = folder / "e/styles/style_sunset/stills/00001";
  const DecodedPhoto png = DecodePhoto(stills + ".png"), jpeg = DecodePhoto(stills + ".jpg"),
                     tiff = DecodePhoto(stills + ".tif");
  EXPECT_EQ(png.image.width, 96);  // the photo's own, beyond the 64 of the fit
  EXPECT_EQ(tiff.bits, 16);
  EXPECT_NE(ReadText(stills + ".png").find("sRGB"), std::string::npos);
  float worst = 0, worst_jpeg = 0;
  for (size_t i = 0; i < png.image.pixels.size(); ++i) {
    worst = std::max(worst, std::abs(png.image.pixels[i] - tiff.image.pixels[i]));
    worst_jpeg = std::max(worst_jpeg, std::abs(png.image.pixels[i] - jpeg.image.pixels[i]));
  }
  EXPECT_LT(worst, 0.5f / 255 + 1e-4f);  // rounding to 8 bits
  EXPECT_LT(worst_jpeg, 40.f / 255);     // of quality 95 with chroma at half size
  EXPECT_TRUE(png.notice.empty() && jpeg.notice.empty() && tiff.notice.empty());
  ASSERT_EQ(Regrade({"render", folder / "e", "--photo", "00002.png", "--size", "48"}).code, 0);
  EXPECT_EQ(ReadImage(folder / "e/styles/style_sunset/stills/00002.png").width, 48);
  const ProgramOutcome none = Regrade({"render", folder / "e", "--photo", "nowhere"});
  EXPECT_EQ(none.code, 3);
  EXPECT_SAYS(none, "00000");
}

// Of voxels; splats are written whole, see SplatPly and SplatsOfVoxels.
TEST(Points, AreWrittenInTheCapturesWorldAndLabelled) {
  const TemporaryFolder folder;
  Synth(folder);
  ASSERT_EQ(Regrade(RunOf(folder, "e", {"--style", Asset("sunset")}, "voxels")).code, 0);
  testing::Said({"export", folder / "e", "--format", "points", "--out", folder / "p"});
  for (const char* name : {"p/field.ply", "p/style_sunset.ply"}) {
    const std::string ply = ReadText(folder / name);
    EXPECT_EQ(ply.substr(0, 4), "ply\n");
    EXPECT_NE(ply.find("comment approximate"), std::string::npos);
    const size_t count_at = ply.find("element vertex ") + 15,
                 body = ply.find("end_header\n") + 11;
    const size_t count = std::stoul(ply.substr(count_at));
    EXPECT_EQ(ply.size(), body + 15 * count) << name;
  }
}

TEST(Clean, RemovesOnlyWhatCanBeMadeAgain) {
  const TemporaryFolder folder;
  Synth(folder);
  std::vector<std::string> run = RunOf(folder, "e", {"--style", Asset("sunset")});
  ASSERT_EQ(Regrade(run).code, 0);
  const std::string style = folder / "e/styles/style_sunset";
  const std::string film = ReadText(style + "/styled.mp4");
  ProgramOutcome done = Regrade({"clean", folder / "e", "--dry-run"});
  EXPECT_EQ(done.code, 0);
  EXPECT_SAYS(done, "can be made again");
  EXPECT_TRUE(fs::exists(style + "/frames"));
  // Nobody answers: nothing is removed.
  EXPECT_EQ(Regrade({"clean", folder / "e"}).code, 0);
  EXPECT_TRUE(fs::exists(style + "/frames"));
  ASSERT_EQ(Regrade({"clean", folder / "e", "--yes"}).code, 0);
  EXPECT_FALSE(fs::exists(style + "/frames"));
  EXPECT_TRUE(ReadText(style + "/styled.mp4") == film);
  ASSERT_EQ(Regrade(run).code, 0);  // made again, to the bit
  EXPECT_TRUE(ReadText(style + "/styled.mp4") == film);
}

// Background spheres, and the background colour that the scene's colour map changes.
TEST(StyledField, IsWhatItsFileHolds) {
  const TemporaryFolder folder;
  Synth(folder);
  std::vector<std::string> run =
      RunOf(folder, "e", {"--style", Asset("sunset"), "--effects", "background=on"}, "voxels");
  *(std::ranges::find(run, "--config") + 1) =
      R"({"fit-resolutions": [24], "fit-steps": [30], "background-layers": 4,
          "background-resolution": 16})";
  testing::Said(run);
  const std::string style = folder / "e/styles/style_sunset";
  const StoredField source = ReadFieldFile(folder / "e/field.npz");
  EXPECT_TRUE(source.field.geometry->spheres.on());
  EXPECT_NE(source.field.background.x, ReadNetworkFile(style + "/network.npz").background.x);
  StyledFile(folder, "style_sunset");
  const StoredField remade = ReadStyledField(folder / "e", style),
                    read = ReadFieldFile(folder / "styled.npz");
  for (int64_t i = 0; i < read.field.appearance.sh.size(); ++i)
    ASSERT_EQ(remade.field.appearance.sh[i], read.field.appearance.sh[i]) << i;
}

TEST(StyledField, HasItsObjectsWeights) {
  const TemporaryFolder folder;
  Synth(folder, {"--effects", "masks"});
  testing::Said(
      RunOf(folder, "e", {"--style", Asset("sunset"), "--masks", folder / "s/masks"}));
  const std::string style = folder / "e/styles/style_sunset";
  WriteFieldFile(folder / "whole.npz",
                 StyledFieldOf(ReadFieldFile(folder / "e/field.npz"),
                               ReadNetworkFile(style + "/network.npz"), 1, nullptr));
  EXPECT_FALSE(ReadText(folder / "whole.npz") == StyledFile(folder, "style_sunset"));
}

}  // namespace
}  // namespace regrade
