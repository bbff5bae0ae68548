#include "evaluate/heat_map.h"

#include <gtest/gtest.h>

#include "tests/evaluate/synthetic_frames.h"

namespace regrade {
namespace {

using namespace regrade::testing;

float Brightness(const Image& map, int x, int y) {
  return map.at(x, y)[0] + map.at(x, y)[1] + map.at(x, y)[2];
}

TEST(HeatMap, DarkerWithTheErrorAndWhiteWithout) {
  const Image earlier = ConstantImage(32, 4, 0.5f);
  Image later = earlier;
  for (int x = 0; x < 32; ++x)
    for (int c = 0; c < 3; ++c) later.at(x, 1)[c] += 0.012f * static_cast<float>(x);
  const Image map = ErrorHeatMap(earlier, later, StillMotion(32, 4));
  EXPECT_EQ(Brightness(map, 0, 0), 3);
  EXPECT_EQ(Brightness(map, 0, 1), 3);
  for (int x = 1; x + 1 < 27; ++x)  // up to 10 dB, the end of the scale
    EXPECT_LT(Brightness(map, x + 1, 1), Brightness(map, x, 1)) << x;
  EXPECT_EQ(Brightness(map, 31, 1), Brightness(map, 30, 1));
}

TEST(HeatMap, MaskedPixelsAreDark) {
  const Image earlier = ConstantImage(8, 8, 1), later = ConstantImage(8, 8, 0);
  PairMotion motion = StillMotion(8, 8);
  *motion.mask.weight.at(3, 5) = 0;
  const Image map = ErrorHeatMap(earlier, later, motion);
  for (int c = 0; c < 3; ++c) EXPECT_EQ(map.at(3, 5)[c], 0.25f);
  EXPECT_GT(map.at(2, 5)[0], map.at(2, 5)[1]);  // an error has a colour, the mask has none
}

TEST(HeatMap, H116_NonFinitePixelsAreDark) {
  Image earlier = ConstantImage(8, 8, 1);
  earlier.at(1, 1)[2] = kNan;
  PairMotion motion = StillMotion(8, 8);
  motion.flow.at(4, 4)[0] = kNan;
  *motion.mask.weight.at(4, 4) = 0;
  const Image map = ErrorHeatMap(earlier, earlier, motion);
  for (const float value : map.pixels) EXPECT_TRUE(value >= 0 && value <= 1);
  EXPECT_EQ(Brightness(map, 1, 1), 0);
  EXPECT_LT(Brightness(map, 4, 4), 1);
}

TEST(HeatMap, WorstPairOfEachSequenceAndGap) {
  const auto levels = [](std::vector<float> levels) {
    std::vector<Image> images;
    for (const float level : levels) images.push_back(ConstantImage(8, 8, level));
    return Frames(std::move(images));
  };
  int computed = 0;
  const PairMotionFunction motion = [&computed](int, int) {
    ++computed;
    return StillMotion(8, 8);
  };
  ConsistencyOptions options;
  options.gaps = {1, 3};
  const ConsistencyReport report =
      EvaluateConsistency(4, motion,
                          {{"source", levels({0, 0, 0, 0})},  // all pairs are identical
                           {"views_2d", levels({0, 0, 0.2f, 0.2f})},
                           {"styled", levels({0, 0.1f, 0.5f, 0.3f})}},
                          options);
  ASSERT_EQ(report.worst.size(), 4);
  EXPECT_EQ(HeatMapFileName(report.worst[0].pair), "views_2d_gap1_00001.png");
  EXPECT_EQ(HeatMapFileName(report.worst[1].pair), "views_2d_gap3_00000.png");
  EXPECT_EQ(HeatMapFileName(report.worst[2].pair), "styled_gap1_00001.png");
  EXPECT_EQ(HeatMapFileName(report.worst[3].pair), "styled_gap3_00000.png");
  EXPECT_EQ(report.worst[0].motion, report.worst[2].motion);  // of the same pair
  EXPECT_EQ(computed, 4);                                     // once for each pair
}

}  // namespace
}  // namespace regrade
