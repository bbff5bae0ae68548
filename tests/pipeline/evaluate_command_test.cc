// `regrade evaluate --frames` from the command line: its files, and its errors about unusable
// frames.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>

#include "evaluate/flow_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "tests/support/evaluated_frames.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_onnx.h"

namespace regrade {
namespace {

using namespace regrade::testing;

TEST(EvaluateCommand, WritesMetricsIntervalsAndHeatMaps) {
  const TemporaryFolder folder;
  WriteFrames(folder / "source", 6);
  WriteFrames(folder / "styled", 6, 0.03f);
  WriteText(folder / "out/heatmaps/styled_gap1_99999.png", "of an earlier evaluation");
  const ProgramOutcome outcome = Evaluate({"--frames", folder / "styled", "--reference",
                                           folder / "source", "--out", folder / "out"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_SAYS(outcome, "95 %");
  const JsonValue json = ReadJsonFile(folder / "out/report.json");
  int maps = 0;
  for (const JsonValue& row : json.At("consistency").AsArray()) {
    const double mean = row.At("tc_psnr_mean_db").AsDouble();
    if (row.At("gap").AsInt() == 1) {
      EXPECT_LE(row.At("tc_psnr_low_db").AsDouble(), mean);
      EXPECT_GE(row.At("tc_psnr_high_db").AsDouble(), mean);
    } else {  // one pair at gap 5
      EXPECT_EQ(row.At("tc_psnr_low_db_why").AsString(), "too few pairs for an interval");
    }
    const Image map = ReadImage(folder / ("out/" + row.At("heat_map").AsString()));
    EXPECT_EQ(map.width, 64);
    EXPECT_EQ(map.height, 48);
    ++maps;
  }
  EXPECT_EQ(maps, 4);
  EXPECT_FALSE(std::filesystem::exists(folder / "out/heatmaps/styled_gap1_99999.png"));
  const std::string page = testing::ReadText(folder / "out/report.html");
  EXPECT_NE(page.find("styled scene, frames 0 and 5"), std::string::npos);
  EXPECT_EQ(page.find("run.json"), std::string::npos);  // no run made these frames
  EXPECT_EQ(page.find("restyled reconstruction"), std::string::npos);
  EXPECT_EQ(json.At("consistency_pairs").AsArray().size(), 2u * (5 + 1));
}

// The exit status tells a required metric that is out of its bound from frames that cannot be
// measured and from a requirement that nothing can fulfil.
TEST(EvaluateCommand, RequiredMetrics) {
  const TemporaryFolder folder;
  WriteFrames(folder / "source", 6);
  WriteFrames(folder / "styled", 6, 0.03f);
  const auto outcome_of = [&](const std::string& require) {
    return Evaluate({"--frames", folder / "styled", "--reference", folder / "source", "--out",
                     folder / "out", "--require", require});
  };
  ProgramOutcome outcome = outcome_of("styled:beauty>=1");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
  outcome = outcome_of("styled:tc-psnr:1>=90");
  EXPECT_EQ(outcome.code, 8);
  EXPECT_SAYS(outcome, "styled:tc-psnr:1>=90: measured");
  EXPECT_TRUE(std::filesystem::exists(folder / "out/report.json"));
  EXPECT_EQ(outcome_of("styled:tc-psnr:1<=90,source:tc-psnr:1>=20").code, 0);
}

TEST(EvaluateCommand, UnusableFramesAreNamed) {
  const TemporaryFolder folder;
  WriteFrames(folder / "source", 4);
  WriteFrames(folder / "styled", 4);
  const auto outcome_of = [&] {
    return Evaluate({"--frames", folder / "styled", "--reference", folder / "source", "--out",
                     folder / "out"});
  };
  std::filesystem::remove(folder / "styled/00002.png");
  ProgramOutcome outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_SAYS(outcome, "frame 00002 is missing between 00001.png and 00003.png");
  WriteText(folder / "styled/00002.png", EncodePng8(Frame(2)).substr(0, 900));
  outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_SAYS(outcome, "styled/00002.png");
  WriteText(folder / "styled/00002.png", EncodePng8(Image(64, 40, 3)));
  outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_SAYS(outcome, "this frame is 64 x 40 px, 00000.png is 64 x 48 px");
  for (const char* name : {"00000.png", "00001.png", "00002.png", "00003.png"})
    std::filesystem::remove(folder / (std::string("styled/") + name));
  WriteText(folder / "styled/left.png", EncodePng8(Frame(0)));
  WriteText(folder / "styled/right.png", EncodePng8(Frame(1)));
  outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_SAYS(outcome, "2 frames, the reference has 4");
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));  // the error precedes all work
}

// One network measures how different frames look from the 2D method's, another one estimates
// motion. An unusable one is refused before any frame is read.
TEST(EvaluateCommand, NetworksOfTheUser) {
  const TemporaryFolder folder;
  WriteFrames(folder / "source", 3);
  WriteFrames(folder / "styled", 3, 0.03f);
  WriteText(folder / "distance.onnx", testing::DistanceNetwork(48, 64));
  WriteText(folder / "flow.onnx", testing::FlowNetwork(48, 64));
  WriteText(folder / "diary.onnx", "Dear diary,");
  const auto evaluate = [&](std::vector<std::string> more) {
    more.insert(more.end(), {"--frames", folder / "styled", "--reference", folder / "source",
                             "--target", folder / "source", "--out", folder / "e"});
    return Evaluate(more);
  };
  const ProgramOutcome done =
      evaluate({"--lpips", folder / "distance.onnx", "--flow", "onnx:" + folder / "flow.onnx"});
  ASSERT_EQ(done.code, 0) << done.text;
  EXPECT_SAYS(done, "LPIPS to 2D");
  const JsonValue report = ReadJsonFile(folder / "e/report.json");
  for (const JsonValue& row : report.At("fidelity").AsArray()) {
    const double lpips = row.At("lpips_to_2d").AsDouble();
    EXPECT_EQ(lpips > 1e-4, row.At("sequence").AsString() == "styled") << lpips;
  }
  EXPECT_NE(testing::ReadText(folder / "e/report.html").find("LPIPS"), std::string::npos);
  for (const char* option : {"--lpips", "--flow"}) {
    const bool flow = std::string(option) == "--flow";
    const ProgramOutcome refused =
        evaluate({option, (flow ? "onnx:" : "") + (folder / "diary.onnx")});
    EXPECT_EQ(refused.code, 4) << refused.text;
    EXPECT_SAYS(refused, "diary.onnx");
  }
}

// Grey and transparent frames are frames: the controls take them, too.
TEST(EvaluateCommand, ControlsAreRows) {
  const TemporaryFolder folder;
  WriteFrames(folder / "source", 4);
  WriteFrames(folder / "styled", 4, 0.03f);
  for (int i = 0; i < 4; ++i)
    WriteText(folder / ("grey/0000" + std::to_string(i) + ".png"),
              EncodePng8(Image(64, 48, 1)));
  const auto evaluate = [&](std::vector<std::string> more) {
    more.insert(more.end(), {"--frames", folder / "styled", "--gaps", "1", "--controls", "on",
                             "--out", folder / "out"});
    const ProgramOutcome done = Evaluate(more);
    EXPECT_EQ(done.code, 0) << done.text;
    std::string names;
    const JsonValue report = ReadJsonFile(folder / "out/report.json");
    for (const JsonValue& row : report.At("fidelity").AsArray())
      names += row.At("sequence").AsString() + " ";
    return names;
  };
  EXPECT_EQ(evaluate({}), "styled control_blurred control_grey ");
  EXPECT_EQ(evaluate({"--reference", folder / "source"}),
            "source styled control_blurred control_grey ");
  EXPECT_EQ(evaluate({"--reference", folder / "source", "--target", folder / "grey"}),
            "source views_2d styled control_linear_map control_blurred control_grey ");
}

TEST(EvaluateCommand, H121_OneFrameIsNoPair) {
  const TemporaryFolder folder;
  WriteFrames(folder / "styled", 1);
  const ProgramOutcome outcome =
      Evaluate({"--frames", folder / "styled", "--out", folder / "out"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_SAYS(outcome, "one frame only");
  EXPECT_SAYS(outcome, "no pair of frames is 1 apart");
  const JsonValue json = ReadJsonFile(folder / "out/report.json");
  EXPECT_TRUE(json.At("consistency").AsArray()[0].At("tc_psnr_mean_db").IsNull());
  EXPECT_TRUE(json.At("consistency_pairs").AsArray().empty());
}

TEST(EvaluateCommand, AProtocolSetsModeAndGaps) {
  const TemporaryFolder folder;
  WriteFrames(folder / "source", 6);
  WriteFrames(folder / "styled", 6, 0.03f);
  const auto evaluate = [&](const std::vector<std::string>& more, const std::string& out) {
    return Evaluate(testing::Joined({"--frames", folder / "styled", "--reference",
                                     folder / "source", "--out", folder / out},
                                    more));
  };
  const ProgramOutcome named = evaluate({"--protocol", "liprf"}, "named");
  ASSERT_EQ(named.code, 0) << named.text;
  EXPECT_SAYS(named, "mode ruder2016");
  const ProgramOutcome spelled =
      evaluate({"--mode", "ruder2016", "--gaps", "1,5", "--warp", "earlier"}, "spelled");
  ASSERT_EQ(spelled.code, 0) << spelled.text;
  const auto report_of = [&](const std::string& out) {
    JsonValue json = ReadJsonFile(folder / (out + "/report.json"));
    json["command"] = json["stages"]["evaluate"]["seconds"] = JsonValue();
    return DumpJson(json);
  };
  EXPECT_EQ(report_of("named"), report_of("spelled"));
  const ProgramOutcome refused = evaluate({"--protocol", "liprf", "--gaps", "1,7"}, "refused");
  EXPECT_EQ(refused.code, 2);
  EXPECT_SAYS(refused, "leave out --gaps");
  const ProgramOutcome fitted =
      evaluate({"--controls", "field"}, "refused");  // of what photos?
  EXPECT_EQ(fitted.code, 2);
  EXPECT_SAYS(fitted, "for runs of regrade only");
  EXPECT_FALSE(std::filesystem::exists(folder / "refused"));
}

// Inputs that a person may give by mistake: each has its exit status and its sentence.
TEST(EvaluateCommand, OddInputsHaveTheirSentences) {
  struct Case {
    const char* name;
    std::function<void(const TemporaryFolder&)> change;  // of folders with four good frames
    int code;
    const char* sentence;
  };
  const auto each = [](const TemporaryFolder& folder, const std::string& name, auto encode) {
    for (int i = 0; i < 4; ++i)
      WriteText(folder / (name + "/0000" + std::to_string(i) + ".png"), encode(Frame(i)));
  };
  const auto with_alpha = [](const Image& frame) {
    Image wide(frame.width, frame.height, 4);
    for (int64_t p = 0; p < frame.num_pixels(); ++p)
      for (int c = 0; c < 4; ++c)
        wide.pixels[4 * p + c] = c < 3 ? frame.pixels[3 * p + c] : 0.5f;
    return EncodePng8(wide);
  };
  const Case cases[] = {
      {"good", [](const auto&) {}, 0, "Consistency"},
      {"all of another size than the reference",
       [&](const auto& folder) {
         each(folder, "styled", [](const Image&) { return EncodePng8(Image(32, 24, 3)); });
       },
       3, "frames of 32 x 24 px, the reference has 64 x 48 px"},
      {"missing at the end",
       [](const auto& folder) { std::filesystem::remove(folder / "styled/00003.png"); }, 0,
       "of the reference 00003.png"},
      {"no folder", [](const auto& folder) { std::filesystem::remove_all(folder / "styled"); },
       3, "styled"},
      {"no frames",
       [](const auto& folder) {
         for (int i = 0; i < 4; ++i)
           std::filesystem::remove(folder / ("styled/0000" + std::to_string(i) + ".png"));
       },
       3, "there are no frames here"},
      {"16 bits", [&](const auto& folder) { each(folder, "styled", EncodePng16); }, 0,
       "more than 8 bits"},
      {"alpha", [&](const auto& folder) { each(folder, "styled", with_alpha); }, 0,
       "transparency, which is ignored"},
      {"grey among colours",
       [](const auto& folder) {
         WriteText(folder / "styled/00002.png", EncodePng8(Image(64, 48, 1)));
       },
       0, "styled"},
      {"flow that is not a number",
       [](const auto& folder) {
         FlowField unknown(64, 48);
         std::ranges::fill(unknown.uv, std::nanf(""));
         for (int i = 0; i < 3; ++i)
           for (const auto& [a, b] : {std::pair{i, i + 1}, std::pair{i + 1, i}})
             WriteFlowFile(folder / ("flow/" + FlowFileName(a, b)), unknown);
       },
       0, "no pair has a comparable pixel"},
  };
  for (const Case& test : cases) {
    SCOPED_TRACE(test.name);
    const TemporaryFolder folder;
    WriteFrames(folder / "source", 4);
    WriteFrames(folder / "styled", 4);
    std::filesystem::create_directories(folder / "flow");
    test.change(folder);
    for (const char* mode : {"lai2018", "stylegaussian"}) {
      if (test.code != 0 && mode != std::string("lai2018")) continue;  // ends before the modes
      std::vector<std::string> words{
          "--frames", folder / "styled", "--reference", folder / "source", "--gaps",
          "1",        "--mode",          mode};
      if (!std::filesystem::is_empty(folder / "flow"))
        words.insert(words.end(), {"--flow", "files:" + (folder / "flow")});
      const ProgramOutcome outcome = Evaluate(words);
      EXPECT_EQ(outcome.code, test.code) << outcome.text;
      const bool no_pair = std::string(test.sentence).starts_with("no pair");
      if (!no_pair || mode == std::string("lai2018")) {
        EXPECT_SAYS(outcome, test.sentence);
      }
      std::string words_said = outcome.text;  // the folder's name is random
      while (words_said.find(folder.path()) != std::string::npos)
        words_said.erase(words_said.find(folder.path()), std::string(folder.path()).size());
      EXPECT_EQ(words_said.find("nan"), std::string::npos) << words_said;
    }
  }
}

TEST(EvaluateCommand, UnusableFlowFilesAreNamed) {
  const TemporaryFolder folder;
  WriteFrames(folder / "styled", 2);
  const auto outcome_of = [&] {
    return Evaluate(
        {"--frames", folder / "styled", "--gaps", "1", "--flow", "files:" + (folder / "flow")});
  };
  ProgramOutcome outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_SAYS(outcome, "there is no flow file from frame 0 to frame 1");
  std::filesystem::create_directories(folder / "flow");
  WriteFlowFile(folder / "flow/00000_00001.flo", FlowField(64, 48));
  outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_SAYS(outcome, "there is no flow file from frame 1 to frame 0");
  EXPECT_SAYS(outcome, "00001_00000.flo");
  WriteFlowFile(folder / "flow/00001_00000.flo", FlowField(32, 24));
  outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_SAYS(outcome, "the flow is 32 x 24 px, the frames 64 x 48 px");
  WriteFlowFile(folder / "flow/00001_00000.flo", FlowField(64, 48));
  EXPECT_EQ(outcome_of().code, 0);
}

}  // namespace
}  // namespace regrade
