// `regrade evaluate --frames` from the command line: its files, and its errors about unusable
// frames.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "evaluate/flow_file.h"
#include "kernels/process/child_process.h"
#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_onnx.h"

namespace regrade {
namespace {

using testing::TemporaryFolder;
using testing::WriteText;

struct Outcome {
  int code = 0;
  std::string text;
};

Outcome Evaluate(const std::vector<std::string>& arguments) {
  ChildOptions options;
  options.argv = {REGRADE_PROGRAM, "evaluate"};
  options.argv.insert(options.argv.end(), arguments.begin(), arguments.end());
  options.wall_limit_s = 120;
  Outcome outcome;
  const ChildResult result =
      RunChild(options, [&outcome](const std::string& line) { outcome.text += line + "\n"; });
  outcome.code = result.end == ChildEnd::kExited ? result.exit_status : 128 + result.signal;
  return outcome;
}

#define EXPECT_OUTPUT(outcome, part) \
  EXPECT_NE(outcome.text.find(part), std::string::npos) << outcome.text

// A wave that moves by a pixel per frame.
Image Frame(int i, float flicker = 0) {
  Image image(64, 48, 3);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      for (int c = 0; c < 3; ++c)
        image.at(x, y)[c] =
            static_cast<float>(0.5 + 0.2 * std::sin(0.4 * (x - i) + 0.2 * y + c) +
                               0.15 * std::sin(0.3 * y) + flicker * ((i * 37) % 5 - 2));
  return image;
}

void WriteFrames(const std::string& folder, int count, float flicker = 0) {
  for (int i = 0; i < count; ++i)
    WriteText(folder + "/0000" + std::to_string(i) + ".png", EncodePng8(Frame(i, flicker)));
}

TEST(EvaluateCommand, WritesMetricsIntervalsAndHeatMaps) {
  const TemporaryFolder folder;
  WriteFrames(folder / "source", 6);
  WriteFrames(folder / "styled", 6, 0.03f);
  WriteText(folder / "out/heatmaps/styled_gap1_99999.png", "of an earlier evaluation");
  const Outcome outcome = Evaluate({"--frames", folder / "styled", "--reference",
                                    folder / "source", "--out", folder / "out"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_OUTPUT(outcome, "95 %");
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
  Outcome outcome = outcome_of("styled:beauty>=1");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
  outcome = outcome_of("styled:tc-psnr:1>=90");
  EXPECT_EQ(outcome.code, 8);
  EXPECT_OUTPUT(outcome, "styled:tc-psnr:1>=90: measured");
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
  Outcome outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_OUTPUT(outcome, "frame 00002 is missing between 00001.png and 00003.png");
  WriteText(folder / "styled/00002.png", EncodePng8(Frame(2)).substr(0, 900));
  outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_OUTPUT(outcome, "styled/00002.png");
  WriteText(folder / "styled/00002.png", EncodePng8(Image(64, 40, 3)));
  outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_OUTPUT(outcome, "this frame is 64 x 40 px, 00000.png is 64 x 48 px");
  std::filesystem::remove(folder / "styled/00002.png");
  std::filesystem::remove(folder / "styled/00003.png");
  outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_OUTPUT(outcome, "2 frames, the reference has 4");
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
  const Outcome done =
      evaluate({"--lpips", folder / "distance.onnx", "--flow", "onnx:" + folder / "flow.onnx"});
  ASSERT_EQ(done.code, 0) << done.text;
  EXPECT_OUTPUT(done, "LPIPS to 2D");
  const JsonValue report = ReadJsonFile(folder / "e/report.json");
  for (const JsonValue& row : report.At("fidelity").AsArray()) {
    const double lpips = row.At("lpips_to_2d").AsDouble();
    EXPECT_EQ(lpips > 1e-4, row.At("sequence").AsString() == "styled") << lpips;
  }
  EXPECT_NE(testing::ReadText(folder / "e/report.html").find("LPIPS"), std::string::npos);
  for (const char* option : {"--lpips", "--flow"}) {
    const bool flow = std::string(option) == "--flow";
    const Outcome refused = evaluate({option, (flow ? "onnx:" : "") + (folder / "diary.onnx")});
    EXPECT_EQ(refused.code, 4) << refused.text;
    EXPECT_OUTPUT(refused, "diary.onnx");
  }
}

TEST(EvaluateCommand, H121_OneFrameIsNoPair) {
  const TemporaryFolder folder;
  WriteFrames(folder / "styled", 1);
  const Outcome outcome = Evaluate({"--frames", folder / "styled", "--out", folder / "out"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_OUTPUT(outcome, "one frame only");
  EXPECT_OUTPUT(outcome, "no pair of frames is 1 apart");
  const JsonValue json = ReadJsonFile(folder / "out/report.json");
  EXPECT_TRUE(json.At("consistency").AsArray()[0].At("tc_psnr_mean_db").IsNull());
  EXPECT_TRUE(json.At("consistency_pairs").AsArray().empty());
}

TEST(EvaluateCommand, AProtocolSetsModeAndGaps) {
  const TemporaryFolder folder;
  WriteFrames(folder / "source", 6);
  WriteFrames(folder / "styled", 6, 0.03f);
  const auto evaluate = [&](const std::vector<std::string>& more, const std::string& out) {
    std::vector<std::string> words{"--frames",        folder / "styled", "--reference",
                                   folder / "source", "--out",           folder / out};
    words.insert(words.end(), more.begin(), more.end());
    return Evaluate(words);
  };
  const Outcome named = evaluate({"--protocol", "liprf"}, "named");
  ASSERT_EQ(named.code, 0) << named.text;
  EXPECT_OUTPUT(named, "mode ruder2016");
  const Outcome spelled = evaluate({"--mode", "ruder2016", "--gaps", "1,5"}, "spelled");
  ASSERT_EQ(spelled.code, 0) << spelled.text;
  EXPECT_EQ(testing::ReadText(folder / "named/report.json"),
            testing::ReadText(folder / "spelled/report.json"));
  const Outcome refused = evaluate({"--protocol", "liprf", "--gaps", "1,7"}, "refused");
  EXPECT_EQ(refused.code, 2);
  EXPECT_OUTPUT(refused, "leave out --gaps");
  EXPECT_FALSE(std::filesystem::exists(folder / "refused"));
}

TEST(EvaluateCommand, UnusableFlowFilesAreNamed) {
  const TemporaryFolder folder;
  WriteFrames(folder / "styled", 2);
  const auto outcome_of = [&] {
    return Evaluate(
        {"--frames", folder / "styled", "--gaps", "1", "--flow", "files:" + (folder / "flow")});
  };
  Outcome outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_OUTPUT(outcome, "there is no flow file from frame 0 to frame 1");
  std::filesystem::create_directories(folder / "flow");
  WriteFlowFile(folder / "flow/00000_00001.flo", FlowField(64, 48));
  outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_OUTPUT(outcome, "there is no flow file from frame 1 to frame 0");
  EXPECT_OUTPUT(outcome, "00001_00000.flo");
  WriteFlowFile(folder / "flow/00001_00000.flo", FlowField(32, 24));
  outcome = outcome_of();
  EXPECT_EQ(outcome.code, 3);
  EXPECT_OUTPUT(outcome, "the flow is 32 x 24 px, the frames 64 x 48 px");
  WriteFlowFile(folder / "flow/00001_00000.flo", FlowField(64, 48));
  EXPECT_EQ(outcome_of().code, 0);
}

}  // namespace
}  // namespace regrade
