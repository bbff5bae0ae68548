// The hard cases of both masks; tests/evaluate/reference_evaluator.py transcribes their
// published definitions.
#include "evaluate/occlusion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "evaluate/consistency.h"
#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

using namespace regrade::testing;

// The norm of LipRF's eq. 14 and the square of Lai et al.'s program hold the mask; the divisor
// is its sum.
TEST(Occlusion, ASoftMaskIsSquaredWithTheError) {
  PairMotion motion{FlowField(8, 6), {}};
  motion.mask.weight = ConstantImage(8, 6, 0.25f, 1);
  *motion.mask.weight.at(0, 0) = 1;
  const PairResult pair =
      ComparePair(ConstantImage(8, 6, 0.5f), ConstantImage(8, 6, 0.6f), motion);
  EXPECT_NEAR(*pair.error, 0.01 * (1 + 47 / 16.0) / (1 + 47 / 4.0), 1e-8);
}

// A public evaluator scores the occluded pixels; here an error in them has no effect.
TEST(Occlusion, ErrorsAreTakenWhereTheMaskIsValid) {
  const auto [forward, backward] = MixedFlows(90, 70, 7);
  const OcclusionMask mask = MaskLai2018(forward, backward);
  const Image later = WaveImage(90, 70, 3, 1);
  Image a = WaveImage(90, 70, 0, 0), spoiled = a;
  for (int y = 0; y < 70; ++y)
    for (int x = 0; x < 90; ++x)
      if (*mask.weight.at(x, y) == 0) spoiled.at(x, y)[0] = 100;
  EXPECT_EQ(*ComparePair(a, later, {forward, mask}).error,
            *ComparePair(spoiled, later, {forward, mask}).error);
}

TEST(Occlusion, H116_UnknownFlowHasWeightZeroAndIsCounted) {
  for (const bool soft : {false, true}) {
    FlowField forward = ConstantFlow(40, 30, 1, 0), backward = ConstantFlow(40, 30, -1, 0);
    forward.at(10, 10)[0] = kNan;
    forward.at(20, 10)[1] = -std::numeric_limits<float>::infinity();
    backward.at(30, 20)[0] = kNan;  // sampled by (29, 20), whose target it is
    const auto mask = soft ? MaskRuder2016(forward, backward) : MaskLai2018(forward, backward);
    EXPECT_EQ(*mask.weight.at(10, 10), 0);
    EXPECT_EQ(*mask.weight.at(20, 10), 0);
    EXPECT_EQ(*mask.weight.at(29, 20), 0);
    EXPECT_EQ(mask.not_finite, 3);
    EXPECT_EQ(mask.disoccluded, 0);
    EXPECT_GT(*mask.weight.at(5, 20), 0.99f);
    EXPECT_TRUE(std::isfinite(mask.Coverage()));
  }
}

TEST(Occlusion, H116_TargetsOutOfTheFrameAreCountedApart) {
  const FlowField forward = ConstantFlow(40, 30, 8, 0), backward = ConstantFlow(40, 30, -8, 0);
  const OcclusionMask lai = MaskLai2018(forward, backward);
  EXPECT_EQ(lai.out_of_frame, 8 * 30);
  EXPECT_EQ(lai.disoccluded + lai.motion_boundary + lai.not_finite, 0);
  EXPECT_EQ(lai.Coverage(), 1) << "the original does not mask them";
  const OcclusionMask ruder = MaskRuder2016(forward, backward);
  // One row and column more: the taps there extend beyond the frame (H117).
  EXPECT_EQ(ruder.out_of_frame, 40 * 30 - 31 * 29);
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 40; ++x)
      if (x >= 31 || y >= 29) {
        EXPECT_EQ(*ruder.weight.at(x, y), 0) << x << " " << y;
      }
  EXPECT_EQ(*ruder.weight.at(10, 10), 1);
}

TEST(Occlusion, H117_ATapOutsideTheFrameMakesNoContribution) {
  // Half a pixel beyond the last column: the position is in no four-pixel cell.
  const FlowField forward = ConstantFlow(30, 20, 0.5f, 0);
  const OcclusionMask mask = MaskRuder2016(forward, ConstantFlow(30, 20, -0.5f, 0));
  for (int y = 0; y < 20; ++y) EXPECT_EQ(*mask.weight.at(29, y), 0);
  EXPECT_EQ(*mask.weight.at(20, 10), 1);
}

TEST(Occlusion, H119_ThresholdGrowsWithMotionAndIsMonotone) {
  const auto trusted = [](float u, float mismatch, bool soft) {
    const FlowField f = ConstantFlow(300, 16, u, 0),
                    b = ConstantFlow(300, 16, -u + mismatch, 0);
    return *(soft ? MaskRuder2016(f, b) : MaskLai2018(f, b)).weight.at(20, 8) > 0;
  };
  for (const bool soft : {false, true}) {
    bool before = true;
    for (float mismatch = 0; mismatch < 12; mismatch += 0.25f) {
      const bool now = trusted(40, mismatch, soft);
      EXPECT_LE(now, before) << "more mismatch made a pixel trusted again";
      before = now;
    }
    EXPECT_FALSE(before);
    // By the formula: |m|^2 > 0.01 (u^2 + (u - m)^2) + 0.5.
    EXPECT_TRUE(trusted(0, 0.70f, soft));
    EXPECT_FALSE(trusted(0, 0.72f, soft));
    EXPECT_TRUE(trusted(100, 13.0f, soft));
    EXPECT_FALSE(trusted(100, 13.5f, soft));
  }
}

}  // namespace
}  // namespace regrade
