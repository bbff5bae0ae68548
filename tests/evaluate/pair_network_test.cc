// Networks with two input images: input order, input range, and refused files.
#include "evaluate/pair_network.h"

#include <gtest/gtest.h>

#include <limits>

#include "evaluate/fidelity.h"
#include "evaluate/optical_flow.h"
#include "evaluate/pair_motion.h"
#include "tests/support/expect_error.h"
#include "tests/support/pictures.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_onnx.h"

namespace regrade {
namespace {

using testing::OneColour;
using testing::TemporaryFolder;

TEST(PairNetwork, MotionIsFromTheFirstToTheSecondInPixels) {
  const TemporaryFolder folder;
  testing::WriteText(folder / "flow.onnx", testing::FlowNetwork(24, 32));
  const PairNetwork network(folder / "flow.onnx");
  const Image dark = OneColour(32, 24, {0.2f, 0.5f, 0.1f}),
              bright = OneColour(32, 24, {0.6f, 0.5f, 0.1f});
  // Inputs are scaled to -1 to 1: a difference of 0.4 in red becomes 0.8.
  const FlowField there = network.Flow(dark, bright), back = network.Flow(bright, dark);
  for (const auto& [x, y] : {std::pair{0, 0}, {31, 23}, {7, 20}}) {
    EXPECT_NEAR(there.at(x, y)[0], 10 + 1.5f * 0.8f, 1e-5);
    EXPECT_NEAR(back.at(x, y)[0], 10 - 1.5f * 0.8f, 1e-5);
    EXPECT_EQ(there.at(x, y)[1], -0.5f);
  }
}

TEST(PairNetwork, EvaluationUsesItsMotion) {
  const TemporaryFolder folder;
  testing::WriteText(folder / "flow.onnx", testing::FlowNetwork(24, 32));
  const FrameSource frames{
      2, [](int i) {
        return OneColour(32, 24, {0.2f + 0.4f * static_cast<float>(i), 0, 0});
      }};
  const PairMotionFunction motion =
      EstimatedMotion(frames, "lai2018", "onnx:" + (folder / "flow.onnx"));
  EXPECT_NEAR(motion(0, 1).flow.at(3, 3)[0], 11.2f, 1e-5);
  EXPECT_NEAR(motion(1, 0).flow.at(3, 3)[0], 8.8f, 1e-5);
}

TEST(PairNetwork, DistanceIsTheNetworkOutput) {
  const TemporaryFolder folder;
  testing::WriteText(folder / "distance.onnx", testing::DistanceNetwork(24, 32));
  const auto distance = PerceptualDistance(folder / "distance.onnx");
  const Image a = OneColour(32, 24, {0.2f, 0.5f, 0.1f}),
              b = OneColour(32, 24, {0.6f, 0.5f, 0.3f});
  EXPECT_EQ(distance(a, a), 0);
  EXPECT_NEAR(distance(a, b), 4 * (0.4 * 0.4 + 0.2 * 0.2) / 3,
              1e-5);  // floats, summed over 768 pixels
  EXPECT_FALSE(PerceptualDistance(""));
  const Image black = OneColour(32, 24, {0, 0, 0}),
              infinite = OneColour(32, 24, {std::numeric_limits<float>::infinity(), 0, 0});
  EXPECT_EQ(distance(infinite, black), 0);

  FidelityTargets targets;
  targets.views_2d = {2, [&](int) { return a; }};
  targets.perceptual = distance;
  const FidelityRow row =
      MeasureFidelity({"styled", {2, [&](int i) { return i == 0 ? a : b; }}}, targets);
  ASSERT_TRUE(row.lpips_to_2d.has_value());
  EXPECT_NEAR(*row.lpips_to_2d, 2 * (0.4 * 0.4 + 0.2 * 0.2) / 3, 1e-5);
  targets.perceptual = {};
  EXPECT_FALSE(MeasureFidelity({"styled", {2, [&](int) { return b; }}}, targets)
                   .lpips_to_2d.has_value());
}

TEST(PairNetwork, RefusalsNameTheFile) {
  const TemporaryFolder folder;
  const auto open = [&](const char* name) { PairNetwork(folder / name); };
  EXPECT_REGRADE_ERROR(open("none.onnx"), ExitCode::kExternalProgram, "none.onnx");
  testing::WriteText(folder / "text.onnx", "Dear diary,");
  EXPECT_REGRADE_ERROR(open("text.onnx"), ExitCode::kExternalProgram, "text.onnx");
  testing::WriteText(folder / "distance.onnx", testing::DistanceNetwork(24, 32));
  const PairNetwork distance(folder / "distance.onnx");
  const Image a = OneColour(32, 24, {0, 0, 0});
  EXPECT_REGRADE_ERROR(distance.Flow(a, a), ExitCode::kExternalProgram, "not a motion field");
  EXPECT_REGRADE_ERROR(distance.Distance(a, Image(8, 8, 3)), ExitCode::kExternalProgram,
                       "size");
}

// If OpenCV's contributed module is installed, its flows find a shift; otherwise they are
// refused with the package's name.
TEST(OpticalFlow, ContributedMethodsFindAShiftOrNameTheirPackage) {
  Image from(96, 72, 3), to(96, 72, 3);
  for (int y = 0; y < 72; ++y)
    for (int x = 0; x < 96; ++x)
      for (int c = 0; c < 3; ++c) {
        const auto paint = [c](double px, double py) {
          return static_cast<float>(0.5 + 0.25 * std::sin(0.31 * px + c) * std::cos(0.23 * py) +
                                    0.2 * std::sin(0.11 * px - 0.17 * py));
        };
        from.at(x, y)[c] = paint(x, y);
        to.at(x, y)[c] = paint(x - 2, y + 1);
      }
  for (const char* name : {"deepflow", "tvl1", "pca-flow", "rlof"}) {
    FlowField flow;
    try {
      flow = ComputeFlow(from, to, name);
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("libopencv-contrib-dev"), std::string::npos)
          << error.what();
      continue;
    }
    double off = 0;
    int count = 0;
    for (int y = 16; y < 56; ++y)
      for (int x = 16; x < 80; ++x, ++count)
        off += std::hypot(flow.at(x, y)[0] - 2, flow.at(x, y)[1] + 1);
    EXPECT_LT(off / count, 0.6)
        << name;  // for a motion of 2.2 px; PCA-flow has the largest error
  }
}

}  // namespace
}  // namespace regrade
