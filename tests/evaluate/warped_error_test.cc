// Forward warping, and what each of its two readings rewards.
#include "evaluate/warped_error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "evaluate/flow_file.h"
#include "evaluate/image_quality.h"
#include "evaluate/tables.h"
#include "evaluate/warped_rows.h"
#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::ConstantFlow;
using testing::ConstantImage;
using testing::Frames;
using testing::kNan;
using testing::NoiseImage;
using testing::WaveImage;

double SquaredDistance(const Image& a, const Image& b) { return *MeanSquaredError(a, b); }

TEST(SoftmaxSplat, MovesByWholePixelsExactly) {
  const Image image = NoiseImage(16, 12, 1), black(16, 12, 3);
  const MovedFrame moved =
      SoftmaxSplat(image, black, black, ConstantFlow(16, 12, 3, -2), 1, 1, 0);
  for (int y = 0; y < 12; ++y)
    for (int x = 0; x < 16; ++x) {
      const bool arrived = x >= 3 && y < 10;
      EXPECT_EQ(*moved.weight.at(x, y), arrived ? 1 : 0);
      for (int c = 0; c < 3; ++c)
        EXPECT_EQ(moved.color.at(x, y)[c], arrived ? image.at(x - 3, y + 2)[c] : 0);
    }
}

// Two pixels of one row meet: the one that fits its target better counts e^10 times more.
TEST(SoftmaxSplat, WherePixelsMeetTheBetterOneIsSeen) {
  Image first(2, 1, 1), second(2, 1, 1);
  first.pixels = {0.8f, 0.2f};
  second.pixels = {0.5f, 0.8f};
  FlowField flow(2, 1);
  flow.uv = {1, 0, 0, 0};
  const MovedFrame moved = SoftmaxSplat(first, first, second, flow, 1, 1, 0);
  const double little = std::exp(-10.0);  // 0.6 of 255 is far beyond the bound
  EXPECT_NEAR(moved.color.pixels[1], (0.8 + 0.2 * little) / (1 + little), 1e-6);
  EXPECT_EQ(moved.weight.pixels[0], 0);
}

TEST(SoftmaxSplat, UnknownAndHugeMotionMovesNothing) {
  Image image = ConstantImage(4, 4, 0.5f);
  image.at(1, 1)[2] = kNan;
  FlowField flow = ConstantFlow(4, 4, 0, 0);
  flow.at(0, 0)[0] = kNan;
  flow.at(2, 2)[1] = 1e30f;
  flow.at(3, 3)[0] = -1e9f;
  const Image black(4, 4, 3);
  const MovedFrame moved = SoftmaxSplat(image, black, black, flow, 1, 1, 0);
  for (const int at : {0, 1, 2, 3}) EXPECT_EQ(*moved.weight.at(at, at), 0) << at;
  EXPECT_EQ(*moved.weight.at(2, 1), 1);
}

TEST(WarpedError, StillFramesHaveTheirPlainDifference) {
  const Image a = NoiseImage(16, 16, 1), b = NoiseImage(16, 16, 2);
  const FlowField still(16, 16);
  const double rmse = std::sqrt(SquaredDistance(a, b));
  const WarpedError published = PublishedWarpedError(a, b, still, SquaredDistance),
                    corrected = CorrectedWarpedError(a, b, a, a, still, SquaredDistance);
  // Alone in its pixel a colour stays, but for the bias of 1e-7 beside a weight of e^-10.
  EXPECT_NEAR(*published.rmse, rmse, 3e-3);
  EXPECT_NEAR(*corrected.rmse, rmse, 1e-6);
  // LPIPS is given 0..255 in one reading and 0..1 in the other.
  EXPECT_NEAR(*published.lpips, 255 * 255 * *published.rmse * *published.rmse, 1e-2);
  EXPECT_NEAR(*corrected.lpips, rmse * rmse, 1e-6);
}

// Half of the frame leaves it: the published mean counts the hole as correct.
TEST(WarpedError, HolesLowerThePublishedReadingOnly) {
  const Image a = ConstantImage(16, 16, 0.4f), b = ConstantImage(16, 16, 0.6f);
  const FlowField half = ConstantFlow(16, 16, 8, 0);
  const WarpedError published = PublishedWarpedError(a, b, half, {}),
                    corrected = CorrectedWarpedError(a, b, a, a, half, SquaredDistance);
  EXPECT_NEAR(*published.rmse, 0.2 / std::sqrt(2.0), 2e-3);
  EXPECT_NEAR(*corrected.rmse, 0.2, 1e-6);
  EXPECT_NEAR(*corrected.lpips, 0.04, 1e-6);  // a mean over the mask, too
  EXPECT_EQ(corrected.coverage, 0.5);
  EXPECT_FALSE(CorrectedWarpedError(a, b, a, a, ConstantFlow(16, 16, 99, 0), {}).rmse);
}

// A black pixel is masked as a hole by the published reading.
TEST(WarpedError, BlackIsAHoleAsPublished) {
  const Image black(16, 16, 3), white = ConstantImage(16, 16, 1);
  const FlowField still(16, 16);
  EXPECT_EQ(*PublishedWarpedError(black, white, still, {}).rmse, 0);
  EXPECT_EQ(*CorrectedWarpedError(black, white, black, black, still, {}).rmse, 1);
}

TEST(WarpedError, SidesBecomeMultiplesOfEight) {
  const Image frame = NoiseImage(61, 47, 3, 4), padded = PadFrame(frame);
  EXPECT_EQ(padded.width, 64);
  EXPECT_EQ(padded.height, 48);
  EXPECT_EQ(padded.channels, 3);
  EXPECT_EQ(padded.at(0, 0)[1], frame.at(0, 0)[1]);
  EXPECT_EQ(padded.at(1, 0)[1], frame.at(0, 0)[1]);      // one column before, two behind
  EXPECT_EQ(padded.at(63, 47)[1], frame.at(60, 46)[1]);  // no row before, one behind
  EXPECT_EQ(padded.at(62, 46)[1], frame.at(60, 46)[1]);
  EXPECT_EQ(PadFrame(NoiseImage(16, 8, 1)).pixels, NoiseImage(16, 8, 1).pixels);
}

ConsistencyOptions Options(const std::string& flow) {
  ConsistencyOptions options{.mode = kWarpedMode};
  options.gaps = {1};
  options.flow = flow;
  return options;
}

// Frames that flicker as a whole: the flow of the styled frames explains it away in part, and
// grey or dark frames have little left to differ.
TEST(WarpedRows, FlickerCountsAndDarknessIsRewarded) {
  std::vector<Image> source, steady, flickering, dark;
  for (int i = 0; i < 4; ++i) {
    source.push_back(WaveImage(96, 64, 2 * i, 0));
    steady.push_back(source.back());
    flickering.push_back(source.back());
    for (float& v : flickering.back().pixels) v += i % 2 ? 0.1f : 0;
    dark.push_back(flickering.back());
    for (float& v : dark.back().pixels) v *= 0.25f;
  }
  const ConsistencyReport report = EvaluateConsistency(Frames(source),
                                                       {{"source", Frames(source)},
                                                        {"styled", Frames(steady)},
                                                        {"flickering", Frames(flickering)},
                                                        {"dark", Frames(dark)}},
                                                       Options("dis-medium"));
  ASSERT_EQ(report.warped.size(), 4u);
  EXPECT_TRUE(report.rows.empty() && report.pairs.empty());
  EXPECT_EQ(report.warped_pairs.size(), 4u * 3);
  const auto& rows = report.warped;
  EXPECT_NEAR(*rows[2].corrected.rmse, 0.1, 0.02);
  EXPECT_LT(*rows[1].corrected.rmse, 0.02);
  EXPECT_LT(*rows[3].corrected.rmse, 0.3 * *rows[2].corrected.rmse);
  EXPECT_EQ(*rows[0].published.rmse, *rows[1].published.rmse);
  EXPECT_EQ(rows[2].corrected.coverage, rows[1].corrected.coverage);  // one motion for all
  const std::string table = FormatTables(report, {});
  EXPECT_NE(table.find("RMSE published"), std::string::npos);
  EXPECT_NE(table.find("styled: fidelity was not measured"), std::string::npos);
}

// Without .flo files of the styled frames there is no published reading, and the row says so.
TEST(WarpedRows, FilesOfTheMeasuredFrames) {
  const testing::TemporaryFolder folder;
  testing::WriteText(folder / "flow/readme", "");
  WriteFlowFile(folder / "flow/00000_00001.flo", ConstantFlow(61, 47, 2, 0));
  const FrameSource frames = Frames({WaveImage(61, 47, 0, 0), WaveImage(61, 47, 2, 0)});
  const auto evaluate = [&] {
    return EvaluateConsistency(frames, {{"source", frames}, {"styled", frames}},
                               Options("files:" + (folder / "flow")))
        .warped;
  };
  auto rows = evaluate();
  EXPECT_TRUE(rows[0].published.rmse.has_value());
  EXPECT_FALSE(rows[1].published.rmse.has_value());
  EXPECT_EQ(rows[1].why, "there are no flow files of these frames");
  EXPECT_LT(*rows[1].corrected.rmse, 1e-6);
  testing::WriteText(folder / "flow/styled/readme", "");
  EXPECT_REGRADE_ERROR(evaluate(), ExitCode::kInput, "no flow file from frame 0 to frame 1");
  WriteFlowFile(folder / "flow/styled/00000_00001.flo", ConstantFlow(61, 47, 2, 0));
  rows = evaluate();
  EXPECT_EQ(*rows[1].published.rmse, *rows[0].published.rmse);
}

}  // namespace
}  // namespace regrade
