#include "stylize/image/mixture_transport.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/image/color_statistics.h"
#include "kernels/image/color_table.h"
#include "stylize/image/mixture_transfer.h"
#include "stylize/image/monge_kantorovich.h"
#include "stylize/image/sample_colors.h"
#include "stylize/image/transport_plan.h"
#include "tests/support/expect_error.h"
#include "tests/support/floating_point_traps.h"
#include "tests/support/record_error.h"
#include "tests/support/threads.h"
#include "tests/support/wavy_picture.h"

namespace regrade {
namespace {

using testing::LargestDifference;
using testing::OneColour;

struct Group {
  double share;
  Vec3d mean;
  double sigma;
};

Image Groups(uint64_t seed, const std::vector<Group>& groups, int side = 64) {
  Image image(side, side);
  for (int64_t i = 0; i < image.num_pixels(); ++i) {
    double place = RandomDouble(seed, 0, i);
    size_t k = 0;
    while (k + 1 < groups.size() && (place -= groups[k].share) >= 0) ++k;
    for (int c = 0; c < 3; ++c) {
      double noise = 0;
      for (int n = 0; n < 12; ++n) noise += RandomDouble(seed, 20 + 12 * c + n, i) - 0.5;
      image.pixels[3 * i + c] =
          static_cast<float>(std::clamp(groups[k].mean[c] + groups[k].sigma * noise, 0.0, 1.0));
    }
  }
  return image;
}

const std::vector<Group> kSkyAndGrass = {{0.4, {0.5, 0.65, 0.85}, 0.04},
                                         {0.6, {0.3, 0.45, 0.2}, 0.05}};
const std::vector<Group> kDusk = {{0.4, {0.8, 0.55, 0.5}, 0.05},
                                  {0.6, {0.25, 0.3, 0.25}, 0.03}};

StyleOptions Gmm(double max_slope = 4) { return {.method = "gmm", .max_slope = max_slope}; }

Image Styled(const Image& photo, const Image& style, const StyleOptions& options = Gmm()) {
  return MakeMixtureTransfer(options, style, SampleColors(photo, "photo", kMixtureSample))
      ->Stylize(photo, 0);
}

TEST(TransportPlan, EqualWeightsAgreeWithTheBestOfAllPermutations) {
  for (uint64_t seed = 0; seed < 60; ++seed) {
    constexpr int kSide = 5;
    std::vector<std::vector<double>> cost(kSide, std::vector<double>(kSide));
    for (int k = 0; k < kSide; ++k)
      for (int l = 0; l < kSide; ++l) cost[k][l] = RandomDouble(seed, k, l);
    std::vector<int> order(kSide);
    std::iota(order.begin(), order.end(), 0);
    double best = 1e300;
    do {
      double sum = 0;
      for (int k = 0; k < kSide; ++k) sum += cost[k][order[k]];
      best = std::min(best, sum);
    } while (std::ranges::next_permutation(order).found);
    const std::vector<double> equal(kSide, 1.0);
    const auto plan = TransportPlan(equal, equal, cost);
    double sum = 0;
    for (int k = 0; k < kSide; ++k)
      for (int l = 0; l < kSide; ++l) sum += plan[k][l] * cost[k][l];
    ASSERT_NEAR(sum, best, 1e-10) << seed;  // weights are rounded to 2^-40
  }
}

TEST(TransportPlan, KeepsBothMarginsAndNoExchangeOfTwoPathsPays) {
  for (uint64_t seed = 0; seed < 40; ++seed) {
    const size_t n = 1 + seed % 16, m = 1 + (seed * 7) % 16;
    std::vector<double> from(n), to(m);
    std::vector<std::vector<double>> cost(n, std::vector<double>(m));
    double sum = 0;
    for (size_t k = 0; k < n; ++k) sum += from[k] = 0.01 + RandomDouble(seed, 1, k);
    for (double& w : from) w /= sum;
    sum = 0;
    for (size_t l = 0; l < m; ++l) sum += to[l] = 0.01 + RandomDouble(seed, 2, l);
    for (double& w : to) w /= sum;
    for (size_t k = 0; k < n; ++k)
      for (size_t l = 0; l < m; ++l) cost[k][l] = RandomDouble(seed, 3 + k, l);
    const auto plan = TransportPlan(from, to, cost);
    for (size_t k = 0; k < n; ++k)
      ASSERT_NEAR(std::accumulate(plan[k].begin(), plan[k].end(), 0.0), from[k], 1e-11);
    for (size_t l = 0; l < m; ++l) {
      double column = 0;
      for (size_t k = 0; k < n; ++k) column += plan[k][l];
      ASSERT_NEAR(column, to[l], 1e-11);
    }
    // Cyclical monotonicity of pairs, necessary for a cheapest plan.
    for (size_t k = 0; k < n; ++k)
      for (size_t l = 0; l < m; ++l)
        for (size_t i = 0; i < n && plan[k][l] > 0; ++i)
          for (size_t j = 0; j < m; ++j)
            if (plan[i][j] > 0) {
              ASSERT_LE(cost[k][l] + cost[i][j], cost[k][j] + cost[i][l] + 1e-12);
            }
  }
}

TEST(GaussianMixture, FindsGroupsThatAreApart) {
  const GaussianMixture mixture =
      FitMixture(SampleColors(Groups(3, kSkyAndGrass), "", kMixtureSample), 2, 1);
  ASSERT_EQ(mixture.size(), 2u);
  for (const Group& group : kSkyAndGrass) {
    const auto part = std::ranges::min_element(
        mixture, {}, [&](const GaussianPart& p) { return Norm(p.mean - group.mean); });
    // 4096 colours: standard errors are 0.008 of a share and 0.001 of a mean.
    EXPECT_NEAR(part->weight, group.share, 0.03);
    EXPECT_LE(Norm(part->mean - group.mean), 0.006);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(std::sqrt(part->covariance(c, c)), group.sigma, 0.004);
  }
}

TEST(MixtureTransport, OnePartIsTheLinearMapOfItsStatistics) {
  StyleOptions options = Gmm(100);
  options.parts = 1;
  const Image photo = Groups(3, kSkyAndGrass), style = Groups(4, kDusk);
  const ColorMap mkl = ComputeMkl(MeasureColor(photo), MeasureColor(style)).map;
  const Image styled = Styled(photo, style, options);
  for (int64_t i = 0; i < photo.num_pixels(); ++i)
    for (int c = 0; c < 3; ++c) {
      const float* p = &photo.pixels[3 * i];
      ASSERT_NEAR(styled.pixels[3 * i + c], mkl({p[0], p[1], p[2]})[c], 2e-6);
    }
}

TEST(MixtureTransport, SkyAndGrassMoveApart) {
  const Image photo = Groups(3, kSkyAndGrass);
  const Image styled = Styled(photo, Groups(4, kDusk));
  Vec3d sky{}, grass{};
  double num_sky = 0, num_grass = 0;
  for (int64_t i = 0; i < photo.num_pixels(); ++i) {
    const float* q = &styled.pixels[3 * i];
    const bool is_sky = photo.pixels[3 * i + 2] > 0.5f;
    (is_sky ? sky : grass) += Vec3d{q[0], q[1], q[2]};
    ++(is_sky ? num_sky : num_grass);
  }
  // The shares differ by sampling: up to 0.02 of a group goes to the other's target.
  EXPECT_LE(Norm(sky / num_sky - kDusk[0].mean), 0.02);
  EXPECT_LE(Norm(grass / num_grass - kDusk[1].mean), 0.02);
}

// The upper half of the picture is of one colour, the lower of another, both with grain.
Image SkyAbove(uint64_t seed, const Vec3d& sky, const Vec3d& ground) {
  Image image = Groups(seed, {{1, {0, 0, 0}, 0}});
  const Image upper = Groups(seed, {{1, sky, 0.03}}), lower = Groups(seed, {{1, ground, 0.03}});
  const size_t half = image.pixels.size() / 2;
  for (size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = (i < half ? upper : lower).pixels[i];
  return image;
}

TEST(MixtureTransport, WithAWeightOfHeightTheSkyTakesTheStylesSky) {
  // By colour alone the blue sky resembles the style's blue ground.
  const Image photo = SkyAbove(3, {0.4, 0.5, 0.8}, {0.6, 0.45, 0.3});
  const Image style = SkyAbove(4, {0.8, 0.5, 0.3}, {0.3, 0.4, 0.6});
  std::vector<double> heights;
  const std::vector<Vec3d> colors = SampleColors(photo, "", kMixtureSample, &heights);
  const auto styled_sky = [&](double weight) {
    StyleOptions options = Gmm(100);
    options.parts = 2;
    options.height_weight = weight;
    const Image styled =
        MakeMixtureTransfer(options, style, colors, heights)->Stylize(photo, 0);
    const int64_t half = styled.num_pixels() / 2;
    Vec3d mean{};
    for (int64_t i = 0; i < half; ++i) {
      const float* p = &styled.pixels[3 * i];
      mean += Vec3d{p[0], p[1], p[2]};
    }
    return mean / static_cast<double>(half);
  };
  EXPECT_LE(Norm(styled_sky(0) - Vec3d{0.3, 0.4, 0.6}), 0.02);
  EXPECT_LE(Norm(styled_sky(1.5) - Vec3d{0.8, 0.5, 0.3}), 0.02);
}

TEST(MixtureTransport, AViewKeepsTheScenesHeights) {
  const Image photo = SkyAbove(3, {0.4, 0.5, 0.8}, {0.6, 0.45, 0.3});
  std::vector<double> heights;
  const std::vector<Vec3d> colors = SampleColors(photo, "", kMixtureSample, &heights);
  GaussianMixture scene = FitMixture(colors, 2, 1);
  MeasureHeights(colors, heights, &scene);
  // A camera that looks up sees the sky alone; its sky is as high as in all photos.
  const GaussianMixture view =
      AdaptMixture(scene, SampleColors(Groups(9, {{1, {0.4, 0.5, 0.8}, 0.03}}), "", 1 << 16));
  ASSERT_EQ(view.size(), 2u);
  for (size_t k = 0; k < 2; ++k) {
    EXPECT_NEAR(scene[k].height, scene[k].mean.z > 0.5 ? 0.75 : 0.25, 0.01);
    EXPECT_EQ(view[k].height, scene[k].height);
  }
}

TEST(MixtureTransport, H180_BothSidesEqualGiveTheIdentity) {
  for (const std::vector<Group>& groups : {kSkyAndGrass, kDusk}) {
    const Image picture = Groups(3, groups);
    const double largest = LargestDifference(Styled(picture, picture), picture);
    EXPECT_LE(largest, testing::RecordBound("a pixel of the style on itself",
                                            testing::Computed::kFloat, largest, 1e-6));
  }
}

TEST(MixtureTransport, H181_OneColourTakesTheStylesMean) {
  const Image style = Groups(4, kDusk);
  const Vec3d mean = MeasureColor(style).mean;
  const Image styled = Styled(OneColour(16, 16, {0.4, 0.4, 0.4}), style);
  for (int64_t i = 0; i < styled.num_pixels(); ++i)
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(styled.pixels[3 * i + c], mean[c], 1e-5);
  // And a style of one colour is taken, to the floor of two steps, and said.
  const auto flat =
      MakeMixtureTransfer(Gmm(), OneColour(16, 16, {0.25, 0.25, 0.25}),
                          SampleColors(Groups(3, kSkyAndGrass), "", kMixtureSample));
  EXPECT_EQ(flat->Notices().at(0), kFlatStyleNotice);
  for (const float v : flat->Stylize(Groups(3, kSkyAndGrass), 0).pixels)
    ASSERT_NEAR(v, 0.25, 6 * 2.0 / 255);
}

TEST(MixtureTransport, H182_GreyPhotoStaysBelowTheSteepestSlope) {
  Image grey(40, 40);
  for (int64_t i = 0; i < grey.num_pixels(); ++i)
    for (int c = 0; c < 3; ++c)
      grey.pixels[3 * i + c] = static_cast<float>(RandomDouble(1, 0, i));
  const std::vector<Vec3d> colors = SampleColors(grey, "", kMixtureSample);
  const MixtureMap map = ComputeMixtureMap(
      FitMixture(colors, 6, 1),
      FitMixture(SampleColors(Groups(4, kDusk), "", kMixtureSample), 6, 1), 4);
  EXPECT_LE(map.slope, 4);
  for (double x = 0; x < 1; x += 0.001) {
    const Vec3d step = map({x + 1e-4, x, x}) - map({x, x, x});
    // Between the table's vertices the map may be somewhat steeper than on it.
    ASSERT_LE(Norm(step) / 1e-4,
              testing::RecordBound("slope away from grey", testing::Computed::kDouble,
                                   Norm(step) / 1e-4, 1.25 * 4));
  }
}

TEST(MixtureTransport, H183_FewerColoursThanParts) {
  Image two(8, 8);
  for (int64_t i = 0; i < two.num_pixels(); ++i)
    for (int c = 0; c < 3; ++c)  // with noise of a fifth of a step of 8 bits
      two.pixels[3 * i + c] = static_cast<float>((i % 4 == 0 ? 0.2 : 0.8) +
                                                 (RandomDouble(5, c, i) - 0.5) * 0.2 / 255);
  const GaussianMixture mixture = FitMixture(SampleColors(two, "", kMixtureSample), 16, 1);
  ASSERT_EQ(mixture.size(), 2u);
  for (const GaussianPart& part : mixture) {
    EXPECT_NEAR(part.weight, part.mean.x < 0.5 ? 0.25 : 0.75, 1e-12);
    EXPECT_GE(SymmetricEigen(part.covariance).values.x, (1 - 1e-12) * kPartVarianceFloor);
  }
  const Image style = Groups(4, kDusk);
  EXPECT_EQ(CheckStyledView(two, Styled(two, style), "v"), 0);
  EXPECT_EQ(CheckStyledView(style, Styled(style, two), "v"), 0);
}

TEST(MixtureTransport, H184_APartWithoutColoursIsLeftOutOfAFitAndKeptOfAPrior) {
  const GaussianMixture prior =
      FitMixture(SampleColors(Groups(3, kSkyAndGrass), "", kMixtureSample), 2, 1);
  // A view of the sky alone, as where a camera looks up.
  const std::vector<Vec3d> sky = SampleColors(Groups(9, {kSkyAndGrass[0]}), "", kMixtureSample);
  const GaussianMixture adapted = AdaptMixture(prior, sky);
  ASSERT_EQ(adapted.size(), 2u);
  double least = 1;
  for (const GaussianPart& part : adapted) least = std::min(least, part.weight);
  EXPECT_NEAR(least, kPriorShare / (1 + kPriorShare) * 0.6, 0.002);
  const Image black = OneColour(16, 16, {0, 0, 0});
  const auto stylizer = MakeMixtureTransfer(
      Gmm(), Groups(4, kDusk), SampleColors(Groups(3, kSkyAndGrass), "", kMixtureSample));
  EXPECT_EQ(CheckStyledView(black, stylizer->Stylize(black, 0), "v"), 0);
}

TEST(MixtureTransport, H185_ASteepMapIsWidenedAndSaid) {
  // Two greys, twenty steps apart, that the style takes to black and white.
  const Image photo =
      Groups(3, {{0.5, {0.46, 0.46, 0.46}, 0.004}, {0.5, {0.54, 0.54, 0.54}, 0.004}});
  const Image style = Groups(4, {{0.5, {0.1, 0.1, 0.1}, 0.03}, {0.5, {0.9, 0.9, 0.9}, 0.03}});
  const std::vector<Vec3d> colors = SampleColors(photo, "", kMixtureSample);
  const GaussianMixture of_style = FitMixture(SampleColors(style, "", kMixtureSample), 2, 1);
  for (const double limit : {2.0, 4.0, 8.0}) {
    const MixtureMap map = ComputeMixtureMap(FitMixture(colors, 2, 1), of_style, limit);
    EXPECT_GT(map.slope_before, limit);
    EXPECT_LE(map.slope, limit);
    EXPECT_LE(SteepestSlope(TabulateColors(kSlopeTable, std::cref(map))), limit);
    EXPECT_GE(map.slope, 0.5 * limit);  // no more than is needed
  }
  const auto stylizer = MakeMixtureTransfer(Gmm(), style, colors);
  ASSERT_EQ(stylizer->Notices().size(), 1u);
  EXPECT_NE(stylizer->Notices()[0].find("max-slope 4"), std::string::npos);
  EXPECT_TRUE(MakeMixtureTransfer(Gmm(), style, SampleColors(style, "", kMixtureSample))
                  ->Notices()
                  .empty());
}

TEST(MixtureTransport, TheSameForAnyNumberOfThreads) {
  const Image photo = Groups(3, kSkyAndGrass, 96), style = Groups(4, kDusk, 80);
  Image first;
  for (const int threads : {1, 2, 3, 7}) {
    const testing::Threads scope(threads);
    const Image styled = Styled(photo, style);
    if (first.empty()) first = styled;
    EXPECT_EQ(styled.pixels, first.pixels) << threads;
  }
}

TEST(MixtureTransport, H29_FewNansPassManyStopWithTheViewsName) {
  Image photo = Groups(3, kSkyAndGrass);
  photo.at(3, 3)[1] = std::numeric_limits<float>::quiet_NaN();
  const auto stylizer =
      MakeMixtureTransfer(Gmm(), Groups(4, kDusk), SampleColors(photo, "", kMixtureSample));
  EXPECT_EQ(CountNotFinite(stylizer->Stylize(photo, 7), ""), 1);
  for (int x = 0; x < 64; ++x) photo.at(x, 5)[0] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_REGRADE_ERROR(stylizer->Stylize(photo, 7), ExitCode::kInput, "view 7: ");
}

}  // namespace
}  // namespace regrade
