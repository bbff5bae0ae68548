// `regrade evaluate --frames` with several folders: which frames belong together, by which
// motion they are compared, and what is reported of requirements.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "evaluate/flow_file.h"
#include "pipeline/files/json_file.h"
#include "tests/support/evaluated_frames.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

using namespace regrade::testing;

// The same frames under numbers that overlap: each is compared with its own moment.
TEST(EvaluateFolders, FramesOfOtherMomentsArePairedByNumber) {
  const TemporaryFolder folder;
  WriteFrames(folder / "source", 6);
  for (int i = 1; i < 7; ++i)
    WriteText(folder / ("styled/take2_" + std::to_string(i) + ".png"), EncodePng8(Frame(i)));
  WriteFrames(folder / "target", 6);
  const ProgramOutcome outcome =
      Evaluate({"--frames", folder / "styled", "--reference", folder / "source", "--target",
                folder / "target", "--gaps", "1", "--out", folder / "out"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  const JsonValue report = ReadJsonFile(folder / "out/report.json");
  const JsonValue& pairing = report.At("pairing").AsArray().at(0);
  EXPECT_EQ(pairing.At("by").AsString(), "number");
  EXPECT_EQ(pairing.At("left_out").AsArray().at(0).AsString(), "take2_6.png");
  EXPECT_EQ(pairing.At("reference_left_out").AsArray().at(0).AsString(), "00000.png");
  EXPECT_EQ(RowOf(report, "styled").At("pairs").AsInt(), 4);
  for (const JsonValue& row : report.At("fidelity").AsArray())
    EXPECT_TRUE(row.At("psnr_to_2d_db_infinite").AsBool()) << DumpJson(row);
  EXPECT_EQ(RowOf(report, "styled").At("tc_psnr_mean_db").AsDouble(),
            RowOf(report, "source").At("tc_psnr_mean_db").AsDouble());
}

// Flow files are called by the numbers of the reference's frames or by their places in its
// folder: the same motion is found under both, also where frames were left out.
TEST(EvaluateFolders, FlowFilesBelongToTheirFrames) {
  const TemporaryFolder folder;
  for (int i = 1; i <= 4; ++i)
    WriteText(folder / ("source/" + std::to_string(i) + ".png"), EncodePng8(Frame(i)));
  for (int i = 2; i <= 4; ++i)
    WriteText(folder / ("styled/000" + std::to_string(i) + ".png"), EncodePng8(Frame(i)));
  const auto coverage = [&](const std::string& name, int first) {
    for (int i = 0; i < 3; ++i)
      for (const bool back : {false, true}) {
        FlowField flow(64, 48);
        for (size_t k = 0; k < flow.uv.size(); k += 2) flow.uv[k] = back ? -1.0f : 1.0f;
        // The flow of the first pair, whose frames were left out, leads nowhere.
        if (i == 0) std::ranges::fill(flow.uv, std::nanf(""));
        const int a = first + i, b = a + 1;
        WriteFlowFile(folder / (name + "/" + (back ? FlowFileName(b, a) : FlowFileName(a, b))),
                      flow);
      }
    const ProgramOutcome outcome =
        Evaluate({"--frames", folder / "styled", "--reference", folder / "source", "--gaps",
                  "1", "--flow", "files:" + (folder / name), "--out", folder / "out"});
    EXPECT_EQ(outcome.code, 0) << outcome.text;
    const JsonValue row = RowOf(ReadJsonFile(folder / "out/report.json"), "styled");
    EXPECT_EQ(row.At("undefined_pairs").AsInt(), 0);
    return row.At("coverage").AsDouble();
  };
  std::filesystem::create_directories(folder / "numbers");
  std::filesystem::create_directories(folder / "places");
  EXPECT_GT(coverage("numbers", 1), 0.9);
  EXPECT_EQ(coverage("places", 0), coverage("numbers", 1));
}

// Several methods in one table, each compared with the first, pair by pair.
TEST(EvaluateFolders, SeveralFoldersAreComparedPairByPair) {
  const TemporaryFolder folder;
  WriteFrames(folder / "source", 6);
  WriteFrames(folder / "a", 6, 0.01f);
  WriteFrames(folder / "b", 6, 0.03f);
  const auto evaluate = [&](const std::vector<std::string>& more) {
    return Evaluate(testing::Joined({"--frames", folder / "a", folder / "b", "--reference",
                                     folder / "source", "--gaps", "1", "--out", folder / "out"},
                                    more));
  };
  const ProgramOutcome outcome = evaluate({"--name", "Ours", "Other & co", "--format", "latex",
                                           "--require", "styled-2:tc-psnr:1<=90"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_SAYS(outcome, "minus Ours & 95 \\%");
  EXPECT_SAYS(outcome, "\nOther \\& co & 1 & 5 & ");
  const JsonValue report = ReadJsonFile(folder / "out/report.json");
  EXPECT_EQ(report.At("labels").At("styled_2").AsString(), "Other & co");
  const JsonValue ours = RowOf(report, "styled"), other = RowOf(report, "styled_2");
  EXPECT_EQ(ours.Find("tc_psnr_difference_db"), nullptr);
  EXPECT_EQ(other.At("difference_pairs").AsInt(), 5);
  const double difference = other.At("tc_psnr_difference_db").AsDouble();
  EXPECT_NEAR(difference,
              other.At("tc_psnr_mean_db").AsDouble() - ours.At("tc_psnr_mean_db").AsDouble(),
              1e-9);
  EXPECT_LT(difference, -3);
  EXPECT_LE(other.At("tc_psnr_difference_low_db").AsDouble(), difference);
  EXPECT_GE(other.At("tc_psnr_difference_high_db").AsDouble(), difference);
  for (const auto& [more, part] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"--name", "one"}, "1 names for 2 folders"},
           {{"--name", "one", "one"}, "the same name"},
           {{"--name"}, "its value is missing"},
           {{"--require", "styled-3:tc-psnr:1>=1"}, "styled_3"},
           {{"--junit", folder / "j.xml"}, "add --require"}}) {
    const ProgramOutcome refused = evaluate(more);
    EXPECT_EQ(refused.code, 2) << refused.text;
    EXPECT_SAYS(refused, part);
  }
  const ProgramOutcome alone = Evaluate({"--frames", folder / "a", folder / "b"});
  EXPECT_EQ(alone.code, 2) << alone.text;
}

TEST(EvaluateFolders, RequirementsBecomeTestCases) {
  const TemporaryFolder folder;
  WriteFrames(folder / "styled", 4, 0.03f);
  const auto evaluate = [&](const std::string& require) {
    return Evaluate({"--frames", folder / "styled", "--gaps", "1", "--json", "--require",
                     require, "--junit", folder / "junit.xml"});
  };
  const ProgramOutcome outcome = evaluate("styled:tc-psnr:1>=90,styled:pairs:1>=2");
  EXPECT_EQ(outcome.code, 8);
  EXPECT_SAYS(outcome, "\"event\":\"requirement\"");
  EXPECT_SAYS(outcome, "\"holds\":true");
  EXPECT_SAYS(outcome, "\"holds\":false");
  const std::string xml = testing::ReadText(folder / "junit.xml");
  EXPECT_NE(xml.find("tests=\"2\" failures=\"1\""), std::string::npos) << xml;
  // A file of an earlier start does not pass for that of one that failed.
  std::filesystem::remove(folder / "styled/00001.png");
  EXPECT_EQ(evaluate("styled:pairs:1>=2").code, 3);
  EXPECT_FALSE(std::filesystem::exists(folder / "junit.xml"));
}

// The true cameras and depth maps of a synthetic capture: the motion is exact, and the same as
// that of its flow files.
TEST(EvaluateFolders, MotionFromCamerasAndDepth) {
  const TemporaryFolder folder;
  WriteCapture(folder / "s", 7, "64x48");
  const auto evaluate = [&](const std::vector<std::string>& more, const std::string& out) {
    return Evaluate(testing::Joined({"--frames", folder / "s/images", "--reference",
                                     folder / "s/images", "--out", folder / out},
                                    more));
  };
  const ProgramOutcome exact =
      evaluate({"--protocol", "geometry", "--cameras", folder / "s/truth/transforms.json",
                "--depth", folder / "s/truth/depth"},
               "exact");
  ASSERT_EQ(exact.code, 0) << exact.text;
  const ProgramOutcome flow =
      evaluate({"--flow", "files:" + (folder / "s/truth/flow")}, "flow");
  ASSERT_EQ(flow.code, 0) << flow.text;
  const JsonValue a = ReadJsonFile(folder / "exact/report.json"),
                  b = ReadJsonFile(folder / "flow/report.json");
  EXPECT_EQ(a.At("stages").At("evaluate").At("protocol").AsString(), "geometry");
  for (const int gap : {1, 5}) {
    EXPECT_GT(RowOf(a, "styled", gap).At("coverage").AsDouble(), gap == 1 ? 0.4 : 0.05);
    // Both compare all pixels of which the flow stays in the frame.
    EXPECT_NEAR(RowOf(a, "styled", gap).At("tc_psnr_unmasked_mean_db").AsDouble(),
                RowOf(b, "styled", gap).At("tc_psnr_unmasked_mean_db").AsDouble(), 0.05);
    // The mask leaves out what is hidden.
    EXPECT_GT(RowOf(a, "styled", gap).At("tc_psnr_mean_db").AsDouble(),
              RowOf(a, "styled", gap).At("tc_psnr_unmasked_mean_db").AsDouble() + 0.5);
  }
  std::filesystem::remove(folder / "s/truth/depth/00003.npy");
  const ProgramOutcome missing =
      evaluate({"--mode", "geometry", "--cameras", folder / "s/truth/transforms.json",
                "--depth", folder / "s/truth/depth"},
               "missing");
  EXPECT_EQ(missing.code, 3) << missing.text;
  EXPECT_SAYS(missing, "00003.png");
  EXPECT_EQ(evaluate({"--mode", "geometry"}, "none").code, 2);
  EXPECT_EQ(evaluate({"--depth", folder / "s/truth/depth"}, "none").code, 2);
}

TEST(EvaluateFolders, AMissingControlSaysWhy) {
  const TemporaryFolder folder;
  WriteFrames(folder / "styled", 3, 0.03f);
  ASSERT_EQ(Evaluate({"--frames", folder / "styled", "--gaps", "1", "--controls", "on", "--out",
                      folder / "out"})
                .code,
            0);
  const JsonValue report = ReadJsonFile(folder / "out/report.json");
  const JsonValue& missing = report.At("missing_controls").AsArray().at(0);
  EXPECT_EQ(missing.At("sequence").AsString(), "control_linear_map");
  EXPECT_FALSE(missing.At("why").AsString().empty());
}

}  // namespace
}  // namespace regrade
