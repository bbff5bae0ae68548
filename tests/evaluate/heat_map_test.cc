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
  std::vector<PairResult> pairs(4);
  for (size_t i = 0; i < pairs.size(); ++i) {
    pairs[i].sequence = "styled";
    pairs[i].from = static_cast<int>(i);
    pairs[i].to = static_cast<int>(i) + 1;
  }
  EXPECT_EQ(WorstPair("styled", 1, pairs), nullptr);  // no pair has an error
  pairs[1].error = 0.1;
  pairs[2].error = 0.3;
  pairs[3].error = 0.9;
  pairs[3].to = 8;
  EXPECT_EQ(WorstPair("styled", 1, pairs), &pairs[2]);
  EXPECT_EQ(WorstPair("styled", 5, pairs), &pairs[3]);
  EXPECT_EQ(WorstPair("source", 1, pairs), nullptr);
  EXPECT_EQ(HeatMapFileName(pairs[2]), "styled_gap1_00002.png");
}

}  // namespace
}  // namespace regrade
