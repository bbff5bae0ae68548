#include "stylize/image/distribution_transfer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/base/random.h"
#include "kernels/image/color_statistics.h"
#include "tests/support/expect_error.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

// Two clusters of colours: a distribution that no moments describe.
Image Clusters(uint64_t seed, const Vec3d& one, const Vec3d& two, double fraction,
               double spread = 0.1) {
  Image image(96, 80);
  for (int64_t i = 0; i < image.num_pixels(); ++i) {
    const uint64_t n = static_cast<uint64_t>(i);
    const Vec3d center = RandomDouble(seed, 0, n) < fraction ? one : two;
    for (int c = 0; c < 3; ++c)
      image.pixels[3 * i + c] = static_cast<float>(
          center[c] + spread * (RandomDouble(seed, static_cast<uint64_t>(c) + 1, n) - 0.5));
  }
  return image;
}
Image Photo(uint64_t seed = 1) { return Clusters(seed, {0.2, 0.3, 0.5}, {0.7, 0.6, 0.5}, 0.5); }
Image Style() { return Clusters(2, {0.8, 0.3, 0.2}, {0.3, 0.5, 0.2}, 0.25); }

Image Constant(float value) {
  Image image(20, 20);
  std::fill(image.pixels.begin(), image.pixels.end(), value);
  return image;
}

StyleOptions Method(const std::string& method, bool scene_wide = false) {
  StyleOptions options;
  options.method = method;
  options.scene_wide = scene_wide;
  return options;
}

Image Styled(const std::string& method, const Image& photo, const Image& style) {
  return MakeDistributionTransfer(Method(method), style)->Stylize(photo, 0);
}

// Largest distance of quantiles over a set of directions.
double Apart(const Image& a, const Image& b) {
  const Vec3d directions[] = {{1, 0, 0},     {0, 1, 0},      {0, 0, 1},     {0.6, 0.8, 0},
                              {0.6, 0, 0.8}, {0, 0.8, -0.6}, {0.8, -0.6, 0}};
  double largest = 0;
  for (const Vec3d& direction : directions) {
    std::vector<double> x, y;
    for (const Vec3d& c : SampleColors(a, "a")) x.push_back(Dot(direction, c));
    for (const Vec3d& c : SampleColors(b, "b")) y.push_back(Dot(direction, c));
    std::sort(x.begin(), x.end());
    std::sort(y.begin(), y.end());
    double sum = 0;
    for (int i = 0; i < 100; ++i)
      sum += std::abs(x[x.size() * i / 100] - y[y.size() * i / 100]) / 100;
    largest = std::max(largest, sum);
  }
  return largest;
}

double LargestDifference(const Image& a, const Image& b) {
  double largest = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i)
    largest = std::max<double>(largest, std::abs(a.pixels[i] - b.pixels[i]));
  return largest;
}

TEST(DistributionTransfer, HistogramMeetsEveryChannelAndIdtEveryDirection) {
  const Image histogram = Styled("histogram", Photo(), Style()),
              idt = Styled("idt", Photo(), Style());
  EXPECT_GE(Apart(Photo(), Style()), 0.2);
  // A cluster of a quarter cannot be met by halves channel by channel; 0.01 is 2.5 of 255
  // steps.
  EXPECT_GE(Apart(histogram, Style()), 0.02);
  EXPECT_LE(Apart(idt, Style()), 0.01);
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(MeasureColor(histogram).mean[c], MeasureColor(Style()).mean[c], 0.003);
}

TEST(DistributionTransfer, H25_IdentityOnTheStyleItself) {
  for (const char* method : {"histogram", "idt"})
    EXPECT_LE(LargestDifference(Styled(method, Style(), Style()), Style()),
              testing::RecordBound("a pixel of the style on itself", testing::Computed::kFloat,
                                   LargestDifference(Styled(method, Style(), Style()), Style()),
                                   1e-6))
        << method;
}

TEST(DistributionTransfer, MapsAreMonotone) {
  std::vector<double> source, style;
  for (uint64_t i = 0; i < 3000; ++i) {
    source.push_back(std::pow(RandomDouble(1, 0, i), 3));
    style.push_back(std::round(RandomDouble(2, 0, i) * 4) / 4);  // five values
  }
  std::sort(source.begin(), source.end());
  std::sort(style.begin(), style.end());
  const MonotoneMap map = MatchHistograms(source, style);
  for (size_t i = 1; i < map.from.size(); ++i) {
    EXPECT_GT(map.from[i], map.from[i - 1]);
    EXPECT_GE(map.to[i], map.to[i - 1]);
  }
  double last = map(-1);
  for (double x = -1; x < 2; x += 0.001) {
    EXPECT_GE(map(x), last - 1e-15);
    last = map(x);
  }
}

TEST(DistributionTransfer, H23_ConstantChannelsTakeTheStylesMeanAndNoiseStaysNoise) {
  const Vec3d mean = MeasureColor(Style()).mean;
  for (const char* method : {"histogram", "idt"}) {
    Image flat = Constant(0.4f);
    // Noise of a tenth of a rounding step.
    for (size_t i = 0; i < flat.pixels.size(); ++i)
      flat.pixels[i] += static_cast<float>((RandomDouble(3, 0, i) - 0.5) * 0.1 / 255);
    const Image styled = Styled(method, flat, Style());
    const ColorStatistics statistics = MeasureColor(styled);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(statistics.mean[c], mean[c], 2e-3) << method;
      EXPECT_LE(
          statistics.covariance(c, c),
          testing::RecordBound("variance that is left of noise", testing::Computed::kFloat,
                               statistics.covariance(c, c), kRoundingVariance))
          << method;
    }
  }
}

TEST(DistributionTransfer, H7_AFlatStyleIsSaid) {
  for (const char* method : {"histogram", "idt"}) {
    const auto stylizer = MakeDistributionTransfer(Method(method), Constant(0.25f));
    ASSERT_EQ(stylizer->Notices().size(), 1u);
    for (const float v : stylizer->Stylize(Photo(), 0).pixels)
      ASSERT_NEAR(v, 0.25, 0.02);  // beyond the outermost quantiles the slope is 1
    EXPECT_TRUE(MakeDistributionTransfer(Method(method), Style())->Notices().empty());
  }
}

TEST(DistributionTransfer, GreyBlackAndTinyPicturesStayFinite) {
  Image grey(30, 20, 1);
  for (size_t i = 0; i < grey.pixels.size(); ++i)
    grey.pixels[i] = static_cast<float>(i % 200) / 255.0f;
  for (const char* method : {"histogram", "idt"})
    for (const Image& photo : {grey, Constant(0), Image(1, 1)})
      EXPECT_EQ(CheckStyledView(photo, Styled(method, photo, Style()), "v"), 0) << method;
}

TEST(DistributionTransfer, H29_FewNansPassManyStopWithTheViewsName) {
  const auto stylizer = MakeDistributionTransfer(Method("idt"), Style());
  Image photo = Photo();
  photo.at(3, 3)[1] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(CountNotFinite(stylizer->Stylize(photo, 7), ""), 1);
  for (int i = 0; i < 90; ++i) photo.at(i, 5)[1] = std::numeric_limits<float>::infinity();
  EXPECT_REGRADE_ERROR(stylizer->Stylize(photo, 7), ExitCode::kInput, "view 7");
}

TEST(DistributionTransfer, H30_ASceneWideMapIsTheSameInAllViews) {
  Image a = Photo(1), b = Clusters(5, {0.3, 0.3, 0.3}, {0.6, 0.5, 0.8}, 0.8);
  for (int c = 0; c < 3; ++c) a.at(3, 3)[c] = b.at(3, 3)[c] = 0.4f;
  std::vector<Vec3d> scene = SampleColors(a, "a");
  for (const Vec3d& color : SampleColors(b, "b")) scene.push_back(color);
  for (const char* method : {"histogram", "idt"}) {
    const auto steady = MakeDistributionTransfer(Method(method, true), Style(), &scene);
    const auto single = MakeDistributionTransfer(Method(method), Style());
    double difference = 0;
    for (int c = 0; c < 3; ++c) {
      EXPECT_EQ(steady->Stylize(a, 0).at(3, 3)[c], steady->Stylize(b, 1).at(3, 3)[c]);
      difference +=
          std::abs(single->Stylize(a, 0).at(3, 3)[c] - single->Stylize(b, 1).at(3, 3)[c]);
    }
    EXPECT_GE(difference, 0.02) << method;
    // The same again, to the bit.
    EXPECT_EQ(single->Stylize(a, 0).pixels, single->Stylize(a, 4).pixels);
  }
}

}  // namespace
}  // namespace regrade
