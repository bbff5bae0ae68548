// Which regions of a scene take which style picture: known regions of a synthetic scene, and
// what cannot be distinguished.
#include "stylize/image/region_match.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"
#include "stylize/image/masked_stylizer.h"
#include "tests/support/record_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_onnx.h"
#include "tests/support/two_regions.h"

namespace regrade {
namespace {

using testing::SkyAndGround;
using testing::TwoRegions;

RegionMatch Match(const RegionFeatures& features, const std::vector<Image>& photos,
                  const std::vector<Image>& styles) {
  std::vector<PictureFeatures> of_photos, of_styles;
  for (const Image& photo : photos) of_photos.push_back(features.Of(photo));
  for (const Image& style : styles) of_styles.push_back(features.Of(style));
  return MatchRegions(of_photos, of_styles);
}

// Of each region's pixels, the share that the right style has.
std::vector<double> RightShares(const RegionMatch& match, const RegionFeatures& features,
                                const TwoRegions& scene) {
  double right[2] = {}, all[2] = {};
  for (size_t i = 0; i < scene.photos.size(); ++i) {
    const std::vector<Image> coverage = RegionCoverage(match, features, scene.photos[i]);
    for (int64_t p = 0; p < scene.photos[i].num_pixels(); ++p) {
      const size_t n = static_cast<size_t>(p);
      const double sky = double{scene.sky[i].pixels[n]};
      EXPECT_NEAR(coverage[0].pixels[n] + coverage[1].pixels[n], 1, 1e-5);
      right[0] += sky * double{coverage[0].pixels[n]};
      right[1] += (1 - sky) * double{coverage[1].pixels[n]};
      all[0] += sky;
      all[1] += 1 - sky;
    }
  }
  return {right[0] / all[0], right[1] / all[1]};
}

TEST(RegionMatch, H189_TwoKnownRegionsTakeTheirStyles) {
  const TwoRegions scene = SkyAndGround(6, 160, 120);
  const std::vector<Image> styles = testing::SkyAndGroundStyles();
  const RegionFeatures features("", styles);
  const RegionMatch match = Match(features, scene.photos, styles);
  EXPECT_EQ(match.Unsure(), 0) << match.Margin();
  const std::vector<double> right = RightShares(match, features, scene);
  // What is missing are pixels beside the border, which are of both.
  for (const size_t k : {0, 1}) {
    const double wrong = 1 - right[k];
    EXPECT_LE(wrong, testing::RecordBound(k == 0 ? "share of the sky with the other style"
                                                 : "share of the ground with the other style",
                                          testing::Computed::kFloat, wrong, 0.05));
  }
  // In the other order the styles change places, and nothing else.
  const std::vector<Image> turned = {styles[1], styles[0]};
  const RegionMatch other = Match(RegionFeatures("", turned), scene.photos, turned);
  EXPECT_NEAR(other.weight_of_style[0], match.weight_of_style[1], 1e-9);
}

TEST(RegionMatch, H189_StylesThatLookAlikeAreUnsure) {
  const TwoRegions scene = SkyAndGround(3, 160, 120);
  const std::vector<Image> styles = testing::SkyAndGroundStyles();
  const RegionFeatures features("", styles);
  // The same picture twice: no region can know. The weights of the parts are rounded, each, so
  // their sum is 1 to a few units in the last place.
  EXPECT_NEAR(Match(features, scene.photos, {styles[0], styles[0]}).Unsure(), 1, 1e-14);
  // Two of three alike: the region of these is unsure, more than the 5 % that are allowed.
  EXPECT_GT(Match(features, scene.photos, {styles[0], styles[1], styles[1]}).Unsure(),
            kMostUnsure);
}

TEST(RegionMatch, H189_AStyleThatNothingResemblesHasNoWeight) {
  const TwoRegions scene = SkyAndGround(3, 160, 120);
  const std::vector<Image> styles = {testing::SkyAndGroundStyles()[0],
                                     testing::SkyAndGroundStyles()[1],
                                     testing::OneColour(60, 40, {0.1, 0.9, 0.1})};
  const RegionMatch match = Match(RegionFeatures("", styles), scene.photos, styles);
  EXPECT_EQ(match.weight_of_style[2], 0);
  // A view that shows one region alone: the others have nothing of it.
  const Image sky = testing::SkyAndGroundStyles()[0];
  const std::vector<Image> coverage = RegionCoverage(match, RegionFeatures("", styles), sky);
  EXPECT_FALSE(ShowsRegion(coverage[1]));
  EXPECT_EQ(*std::ranges::max_element(coverage[1].pixels), 0);
  EXPECT_NEAR(*std::ranges::min_element(coverage[0].pixels), 1, 1e-5);
}

// A spot in the sky that turns into ground by and by: on the way its share is small.
TEST(RegionMatch, H189_AViewShowsARegionByMoreThanAHalfOrNotAtAll) {
  const TwoRegions scene = SkyAndGround(3, 160, 120);
  const std::vector<Image> styles = testing::SkyAndGroundStyles();
  const RegionFeatures features("", styles);
  const RegionMatch match = Match(features, scene.photos, styles);
  float most = 0;
  for (int t = 35; t <= 50; ++t) {
    Image picture = styles[0];
    for (int y = 20; y < 23; ++y)
      for (int x = 20; x < 23; ++x)
        for (int c = 0; c < 3; ++c)
          picture.at(x, y)[c] +=
              static_cast<float>(t) / 50 * (styles[1].at(x, y)[c] - picture.at(x, y)[c]);
    most = *std::ranges::max_element(RegionCoverage(match, features, picture)[1].pixels);
    EXPECT_TRUE(most == 0 || most > 0.5f) << t << " " << most;
  }
  EXPECT_GT(most, 0.5f);
}

TEST(RegionMatch, H6_PicturesOfOneColourAreMatched) {
  const std::vector<Image> styles = {testing::OneColour(64, 48, {0.2, 0.3, 0.8}),
                                     testing::OneColour(64, 48, {0.8, 0.5, 0.2})};
  const RegionFeatures features("", styles);
  const RegionMatch match =
      Match(features, {testing::OneColour(80, 60, {0.3, 0.4, 0.8})}, styles);
  EXPECT_NEAR(match.weight_of_style[0], 1, 1e-9);
  EXPECT_EQ(match.Unsure(), 0);
  for (const Image& region :
       RegionCoverage(match, features, testing::OneColour(80, 60, {0, 0, 0})))
    for (const float v : region.pixels) ASSERT_TRUE(v == 0 || v == 1) << v;
}

// Grey of one mean, flat on the left and with grain on the right.
Image FlatAndGrainy(int width, int height, bool left, bool right) {
  Image image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const bool grain = x < width / 2 ? left : right;
      const float v = grain ? ((x / 2 + y / 2) % 2 == 0 ? 0.35f : 0.65f) : 0.5f;
      for (int c = 0; c < 3; ++c) image.at(x, y)[c] = v;
    }
  return image;
}

TEST(RegionMatch, ANetworkTellsWhatColoursDoNot) {
  // |horizontal edges| under a wide box: what a texture is, whatever its colour.
  testing::TinyOnnx network;
  network.Input("image", 3);
  std::vector<float> edge(3 * 2, 0), box(9 * 9, 1.0f / 81);
  edge[0] = 4, edge[1] = -4;
  network.Weights("edge", {1, 3, 1, 2}, edge);
  network.Weights("box", {1, 1, 9, 9}, box);
  network.Node("Conv", {"image", "edge"}, "d",
               testing::TinyOnnx::Integers("kernel_shape", {1, 2}));
  network.Node("Abs", {"d"}, "a");
  network.Node("Conv", {"a", "box"}, "feat",
               testing::TinyOnnx::Integers("kernel_shape", {9, 9}));
  network.Output("feat", 1);
  const testing::TemporaryFolder folder;
  testing::WriteText(folder / "edges.onnx", network.Bytes());

  const std::vector<Image> photos = {FlatAndGrainy(384, 288, false, true)};
  const std::vector<Image> styles = {FlatAndGrainy(384, 288, false, false),
                                     FlatAndGrainy(384, 288, true, true)};
  EXPECT_GT(Match(RegionFeatures("", styles), photos, styles).Unsure(), kMostUnsure);
  const RegionFeatures features(folder / "edges.onnx", styles);
  const RegionMatch match = Match(features, photos, styles);
  EXPECT_LE(match.Unsure(), kMostUnsure);
  const std::vector<Image> coverage = RegionCoverage(match, features, photos[0]);
  double right = 0;
  for (int y = 0; y < 288; ++y)
    for (int x = 0; x < 384; ++x)
      right += double{*coverage[x < 192 ? 0 : 1].at(x, y)} / (384 * 288);
  EXPECT_GE(right, 0.95);
}

}  // namespace
}  // namespace regrade
