// Edge maps: what changes them, and what their similarity sees.
#include "evaluate/edge_map.h"

#include <gtest/gtest.h>

#include <cmath>

#include "evaluate/edge_network.h"
#include "evaluate/image_quality.h"
#include "tests/evaluate/synthetic_frames.h"

namespace regrade {
namespace {

using namespace regrade::testing;

TEST(EdgeMap, AgreesWithItsDefinition) {
  Image picture(3, 2, 1);
  picture.pixels = {0, 0.3f, 0.3f, 0.4f, 0.4f, 0.4f};
  // Squares of the gradient: (0.3, 0.4), (0, 0.1), (0, 0.1); the last row has none.
  const double mean = (0.25 + 0.01 + 0.01) / 6;
  const Image edges = GradientEdges(picture);
  EXPECT_EQ(edges.channels, 1);
  const double expected[] = {0.25 / (0.25 + mean), 0.01 / (0.01 + mean), 0.01 / (0.01 + mean)};
  for (int x = 0; x < 3; ++x) {
    EXPECT_NEAR(*edges.at(x, 0), expected[x], 1e-6) << x;  // floats
    EXPECT_EQ(*edges.at(x, 1), 0) << x;
  }
  for (const float e : GradientEdges(ConstantImage(8, 8, 0.5f)).pixels) EXPECT_EQ(e, 0);
}

TEST(EdgeMap, BrightnessAndContrastDoNotChangeIt) {
  const Image picture = WaveImage(60, 50, 0, 0);
  Image darker = picture;
  for (float& p : darker.pixels) p = 0.25f * p + 0.1f;
  const Image edges = GradientEdges(picture), of_darker = GradientEdges(darker);
  EXPECT_GT(*Ssim(edges, of_darker), 0.9999);
  EXPECT_LT(*Ssim(edges, GradientEdges(WaveImage(60, 50, 3, 0))), 0.9);
  EXPECT_LT(*Ssim(edges, GradientEdges(NoiseImage(60, 50, 3))), 0.5);
}

TEST(EdgeMap, UnknownPixelsStayUnknown) {
  Image picture = WaveImage(20, 15, 0, 0);
  picture.at(7, 4)[1] = kNan;
  picture.at(19, 14)[0] = kNan;
  const Image edges = GradientEdges(picture);
  int unknown = 0;
  for (const float e : edges.pixels) unknown += std::isnan(e);
  // The pixel, and its neighbours to the left and above.
  EXPECT_EQ(unknown, 6);
  EXPECT_TRUE(std::isnan(*edges.at(7, 4)) && std::isnan(*edges.at(6, 4)) &&
              std::isnan(*edges.at(7, 3)));
}

TEST(EdgeMap, NoneIsAskedForByAnEmptyText) {
  EXPECT_FALSE(EdgeMaps(""));
  EXPECT_TRUE(EdgeMaps("gradient"));
}

}  // namespace
}  // namespace regrade
