// The report of a whole run: heat maps, curves, posters, and the command that repeats it.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "kernels/render/field_renderer.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "tests/support/source_dir.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

using testing::Regrade;
using testing::TemporaryFolder;

int HeatMapFiles(const std::string& folder) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder + "/heatmaps"))
    files += entry.path().extension() == ".png";
  return files;
}

// The number of rows that name a heat map; each must exist.
int HeatMapsNamed(const std::string& folder) {
  int maps = 0;
  const JsonValue report = ReadJsonFile(folder + "/report.json");
  for (const JsonValue& row : report.At("consistency").AsArray()) {
    const JsonValue* path = row.Find("heat_map");
    if (path == nullptr) continue;
    EXPECT_EQ(ReadImage(folder + "/" + path->AsString()).width, 64);
    EXPECT_GE(row.At("heat_map_from").AsInt(), 0);
    ++maps;
  }
  return maps;
}

// Keys of all objects in `value`.
void AddKeys(const JsonValue& value, std::set<std::string>* keys) {
  if (value.IsArray())
    for (const JsonValue& element : value.AsArray()) AddKeys(element, keys);
  if (!value.IsObject()) return;
  for (const auto& [key, member] : value.AsObject()) {
    keys->insert(key);
    AddKeys(member, keys);
  }
}

// FORMATS.md explains each key of the report, and each event of --json. NAME_why and
// NAME_infinite are explained once for all names.
void ExpectDocumented(const std::set<std::string>& keys) {
  const std::string formats = testing::ReadText(testing::SourceDir() + "/FORMATS.md");
  for (const std::string& key : keys) {
    std::string name = key;
    for (const std::string ending : {"_why", "_infinite"})
      if (key.ends_with(ending)) name = key.substr(0, key.size() - ending.size());
    EXPECT_NE(formats.find("`" + name + "`"), std::string::npos) << key;
  }
}

TEST(RunReport, ShowsEveryPartOfTheRun) {
  const TemporaryFolder folder;
  const std::string style = testing::SourceDir() + "/assets/style_sunset.png";
  testing::WriteCapture(folder / "s", 6, "96x72");
  std::vector<std::string> run =
      testing::Words("--preset draft --effects exposure=off --device cpu --verbose");
  run.insert(run.begin(), {"run", folder / "s/truth", "--style", style, "--out", folder / "e"});
  for (const std::string& flag : testing::TinyFlags()) run.push_back(flag);
  run.insert(run.end(), {"--config", R"({"style-rays": 512})"});
  const testing::ProgramOutcome done = Regrade(run);
  ASSERT_EQ(done.code, 0) << done.text;
  EXPECT_SAYS(done, "exposure off: not measured (off by --effects)");

  // Three sequences at the photos' positions and three along the film's path, at gaps 1 and 5;
  // the path has three frames, so no pair is 5 apart.
  EXPECT_EQ(HeatMapsNamed(folder / "e/styles/style_sunset"), 9);
  EXPECT_EQ(HeatMapFiles(folder / "e/styles/style_sunset"), 9);
  const JsonValue report = ReadJsonFile(folder / "e/styles/style_sunset/report.json");
  std::set<std::string> keys;
  AddKeys(report, &keys);
  AddKeys(ReadJsonFile(folder / "e/poses/photos.json"), &keys);
  ExpectDocumented(keys);
  const JsonValue& fit = report.At("stages").At("reconstruct");
  EXPECT_EQ(fit.At("psnr_at_steps").AsArray().back().AsArray()[0].AsInt(), 60);
  EXPECT_GT(fit.At("cpu_seconds").AsDouble(), 0);
  const JsonValue& few = report.At("stages").At("render").At("seen_by_few");
  ASSERT_EQ(few.At("photos").AsArray().size(), 6u);
  for (const JsonValue& share : few.At("photos").AsArray()) {
    if (share.IsNull()) continue;  // the view shows no surface
    EXPECT_GE(share.AsDouble(), 0);
    EXPECT_LE(share.AsDouble(), 1);
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "e/styles/style_sunset/views_2d.mp4"));
  const std::string page = testing::ReadText(folder / "e/styles/style_sunset/report.html");
  for (const char* part :
       {"PSNR of the fit over steps", "Lipschitz bound over steps", "positions of the cameras",
        "styled scene, frames ", "views_2d.mp4", "<td class=\"n soft\">not measured"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
  size_t posters = 0;
  for (size_t at = page.find(" poster=\"data:image/jpeg"); at != std::string::npos;
       at = page.find(" poster=\"data:image/jpeg", at + 1))
    ++posters;
  EXPECT_EQ(posters, 3u);

  // The scene to walk through, beside the report: without paths, or names or metadata of
  // photos.
  EXPECT_NE(page.find("<a href=\"scene.html\">"), std::string::npos);
  const std::string scene = testing::ReadText(folder / "e/styles/style_sunset/scene.html");
  EXPECT_NE(scene.find("\"name\":\"style_sunset\""), std::string::npos);
  for (const char* private_part : {".png", ".jpg", "e/styles"})
    EXPECT_EQ(scene.find(private_part), std::string::npos) << private_part;
  EXPECT_EQ(scene.find(folder / ""), std::string::npos);
  EXPECT_NE(scene.find("id=\"network_0\""), std::string::npos);
  // "Exif" in base64: the encoder's block, without entries.
  for (size_t at = 0; (at = scene.find("RXhpZg", at)) != std::string::npos; ++at)
    EXPECT_EQ(scene.substr(at, 27), "RXhpZgAASUkqAAgAAAAAAAAAAAD");

  // A page of its own names the photos, too, or nothing.
  const auto page_of = [&folder](const std::string& names) {
    EXPECT_EQ(
        Regrade({"page", folder / "e", "--names", names, "--out", folder / "p.html"}).code, 0);
    return testing::ReadText(folder / "p.html");
  };
  const std::string named = page_of("on"), anonymous = page_of("off");
  EXPECT_NE(named.find("\"name\":\"style_sunset\""), std::string::npos);
  EXPECT_NE(named.find("\"name\":\"00000.png\""), std::string::npos);
  for (const char* private_part : {"sunset", ".png", ".jpg", "\"name\""})
    EXPECT_EQ(anonymous.find(private_part), std::string::npos) << private_part;

  // The command in the report results in the same options.
  std::vector<std::string> again;
  for (const JsonValue& word : report.At("command").AsArray()) again.push_back(word.AsString());
  ASSERT_EQ(again[0], "regrade");
  again.erase(again.begin());
  *(std::find(again.begin(), again.end(), "--out") + 1) = folder / "again";
  again[0] = "pose";
  EXPECT_EQ(Regrade(again).code, 0);
  const JsonValue were = ReadJsonFile(folder / "e/run.json").At("options"),
                  are = ReadJsonFile(folder / "again/run.json").At("options");
  for (const auto& [name, value] : were.AsObject())
    // The report is of one style, by name; and how much is said changes no result.
    if (name != "out" && name != "threads" && name != "name" && name != "verbose") {
      EXPECT_EQ(DumpJson(value, -1), DumpJson(are.At(name), -1)) << name;
    }

  // Where things are, how long it took and how it went are the last lines.
  for (const char* part :
       {"film ", "styles/style_sunset/styled.mp4", "page ", "took ",
        "sharp: ", "; steady: ", "; faithful: ", "next: ", "stage 2 of 7: fitting"})
    EXPECT_NE(done.text.find(part), std::string::npos) << part << "\n" << done.text;
  EXPECT_LT(page.find("class=assessment"), page.find("class=mainfilm"));
  EXPECT_LT(page.find("class=mainfilm"), page.find("class=compare"));

  // Evaluated again with other pairs: the maps of the earlier ones are gone.
  testing::Said({"evaluate", folder / "e", "--gaps", "2"});
  for (const char* other : {"--format=csv", "--out=x", "--target=x"})
    EXPECT_EQ(Regrade({"evaluate", folder / "e", other}).code, 2) << other;
  for (const std::vector<std::string>& nothing :
       {std::vector<std::string>{"refine", folder / "e", "--require", "styled:tc-psnr:1>=1"},
        {"render", folder / "e", "--part", "1/2", "--junit", folder / "j.xml"},
        {"stylize", folder / "e", "--style", style, "--require", "styled:lpips-to-2d<=1"},
        {"contact-sheet", folder / "e", "--out", folder / "x.jpg"},
        {"export", folder / "e", "--format", "cube", "--out", folder / "x"}})
    EXPECT_EQ(Regrade(nothing).code, 2) << nothing[0];
  // Masks that no photo has are named before the fit.
  std::filesystem::create_directories(folder / "none");
  const testing::ProgramOutcome masked =
      Regrade({"run", folder / "s/truth", "--style", style, "--out", folder / "masked",
               "--masks", folder / "none", "--tracks", "given"});
  EXPECT_EQ(masked.code, 3);
  EXPECT_SAYS(masked, "has no picture with the name of a photo");
  EXPECT_FALSE(std::filesystem::exists(folder / "masked/field.npz"));
  EXPECT_EQ(HeatMapsNamed(folder / "e/styles/style_sunset"), 6);
  EXPECT_EQ(HeatMapFiles(folder / "e/styles/style_sunset"), 6);

  // With the rows that bound the table: of the views also photos, of which the 2D method has no
  // picture of those held out, and all rows have fidelity.
  const testing::ProgramOutcome bounded =
      Regrade({"evaluate", folder / "e", "--protocol", "lai2018", "--controls", "field"});
  ASSERT_EQ(bounded.code, 0) << bounded.text;
  const JsonValue table = ReadJsonFile(folder / "e/styles/style_sunset/report.json");
  std::set<std::string> measured_rows;
  for (const JsonValue& row : table.At("fidelity").AsArray())
    measured_rows.insert(row.At("sequence").AsString());
  EXPECT_EQ(measured_rows.size(), 3u + 7 + 3 + 3);
  for (const JsonValue& row : table.At("consistency").AsArray()) {
    const std::string sequence = row.At("sequence").AsString();
    EXPECT_EQ(measured_rows.count(sequence), 1u) << sequence;
    EXPECT_EQ(row.At("undefined_pairs").AsInt() > 0, sequence == "photos_2d") << sequence;
  }
  for (const char* sequence :
       {"photos", "photos_2d", "control_blurred", "control_grey", "control_linear_map",
        "path_control_grey", "control_field_2d", "control_ceiling"})
    EXPECT_EQ(measured_rows.count(sequence), 1u) << sequence;
  // The field of the 2D method's pictures is one of them, not the scene's, and is fitted once.
  const auto to_2d = [&](const char* sequence) {
    for (const JsonValue& row : table.At("fidelity").AsArray())
      if (row.At("sequence").AsString() == sequence) return row.At("psnr_to_2d_db").AsDouble();
    return 0.0;
  };
  EXPECT_GT(to_2d("control_field_2d"), to_2d("source") + 1);
  // No colours of these splats are closer than those that were fitted to the pictures.
  EXPECT_GT(to_2d("control_ceiling"), to_2d("styled"));
  EXPECT_GT(to_2d("control_ceiling"), to_2d("control_linear_map"));
  EXPECT_SAYS(bounded, "fitted to the 2D method's pictures");
  const testing::ProgramOutcome again_bounded =
      Regrade({"evaluate", folder / "e", "--gaps", "2", "--controls", "field"});
  ASSERT_EQ(again_bounded.code, 0) << again_bounded.text;
  EXPECT_EQ(again_bounded.text.find("fitted to the 2D method's pictures"), std::string::npos);
}

// H157: a style picture of one colour is reported on the terminal, in report.json and on the
// page. H158: up to the field, no optical flow is computed.
TEST(RunReport, H157_H158_AGreyStyleIsNamedAndWithoutEvaluationNothingMoves) {
  const TemporaryFolder folder;
  Image grey(32, 24, 3);
  for (float& value : grey.pixels) value = 0.5f;
  WritePng8(folder / "grey.png", grey);
  testing::WriteCapture(folder / "s", 6, "96x72");
  std::vector<std::string> flags = testing::TinyFlags();
  flags.insert(flags.end(),
               {"--out", folder / "e", "--preset", "draft", "--effects", "exposure=off"});
  std::vector<std::string> fit{"reconstruct", folder / "s/truth"};
  fit.insert(fit.end(), flags.begin(), flags.end());
  const testing::ProgramOutcome fitted = Regrade(fit);
  ASSERT_EQ(fitted.code, 0) << fitted.text;
  EXPECT_EQ(fitted.text.find("flow"), std::string::npos) << fitted.text;
  for (const char* name : {"styles", ".regrade/stages/style_2d.json", "styled.mp4"})
    EXPECT_FALSE(std::filesystem::exists(folder / (std::string("e/") + name))) << name;

  std::vector<std::string> run{"run", folder / "s/truth", "--style", folder / "grey.png"};
  run.insert(run.end(), flags.begin(), flags.end());
  const testing::ProgramOutcome done = Regrade(run);
  ASSERT_EQ(done.code, 0) << done.text;
  const JsonValue stages = ReadJsonFile(folder / "e/styles/grey/report.json").At("stages");
  const JsonValue* notices = stages.At("style_2d").Find("notices");
  ASSERT_NE(notices, nullptr);
  const std::string notice = notices->AsArray()[0].AsString();
  EXPECT_NE(notice.find("single colour"), std::string::npos) << notice;
  EXPECT_SAYS(done, notice);
  EXPECT_NE(testing::ReadText(folder / "e/styles/grey/report.html").find("single colour"),
            std::string::npos);
}

}  // namespace
}  // namespace regrade
