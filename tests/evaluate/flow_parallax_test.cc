#include "evaluate/flow_parallax.h"

#include <gtest/gtest.h>

#include <cmath>

namespace regrade {
namespace {

constexpr int kWidth = 160, kHeight = 120;
constexpr double kFocal = 150;  // pixels

// Flow of a pinhole camera that turns by `turn` about its vertical axis and moves by `step`
// sideways, before points of depth 2 (left half) and 3 (right half).
FlowField TrueFlow(double turn, double step) {
  FlowField flow(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const double depth = x < kWidth / 2 ? 2 : 3;
      const double px = (x + 0.5 - 0.5 * kWidth) / kFocal * depth - step;
      const double py = (y + 0.5 - 0.5 * kHeight) / kFocal * depth;
      const double tx = std::cos(turn) * px - std::sin(turn) * depth;
      const double tz = std::sin(turn) * px + std::cos(turn) * depth;
      flow.at(x, y)[0] = static_cast<float>(kFocal * tx / tz + 0.5 * kWidth - x - 0.5);
      flow.at(x, y)[1] = static_cast<float>(kFocal * py / tz + 0.5 * kHeight - y - 0.5);
    }
  return flow;
}

TEST(FlowParallax, ATurnHasMotionAndNoParallax) {
  const FlowMotion turn = MeasureFlowMotion(TrueFlow(0.1, 0));
  EXPECT_NEAR(turn.motion, 0.1 * kFocal, 2);
  // Beyond the first order: the angle's square times the flow.
  EXPECT_LT(turn.parallax, 0.3);
}

TEST(FlowParallax, AStepHasTheDifferenceOfDepths) {
  // 150 px * 0.1 = 15 px at depth 1: 7.5 px and 5 px. A smooth turn explains part of the jump.
  const FlowMotion step = MeasureFlowMotion(TrueFlow(0, 0.1));
  EXPECT_NEAR(step.motion, 6.25, 1.3);
  EXPECT_GT(step.parallax, 0.3);
  EXPECT_GT(MeasureFlowMotion(TrueFlow(0.1, 0.1)).parallax, 0.3);
}

TEST(FlowParallax, UnknownFlowIsIgnored) {
  FlowField flow = TrueFlow(0.1, 0);
  for (int x = 0; x < kWidth; ++x)
    for (int y = 0; y < kHeight / 3; ++y) flow.at(x, y)[0] = NAN;
  EXPECT_LT(MeasureFlowMotion(flow).parallax, 0.3);
  for (float& v : flow.uv) v = NAN;
  EXPECT_EQ(MeasureFlowMotion(flow).motion, 0);
}

}  // namespace
}  // namespace regrade
