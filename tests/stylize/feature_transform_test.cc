#include "stylize/image/feature_transform.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

constexpr int kChannels = 5;

// Five correlated channels; `rank` of them are independent.
FeatureMap Features(uint64_t seed, double spread, double level, int rank = kChannels) {
  FeatureMap map(kChannels, 60, 90);
  for (int64_t i = 0; i < map.num_pixels(); ++i) {
    double source[kChannels];
    for (int c = 0; c < kChannels; ++c)
      source[c] = RandomDouble(seed, static_cast<uint64_t>(c), static_cast<uint64_t>(i)) - 0.5;
    for (int c = 0; c < kChannels; ++c) {
      double value = level + c;
      for (int k = 0; k < rank; ++k)
        value += spread * source[k] * (k == c ? 1 : 0.5 * std::sin(seed + 3.0 * k + 7.0 * c));
      map.plane(c)[i] = static_cast<float>(value);
    }
  }
  return map;
}

FeatureMap Transformed(FeatureMap content, const FeatureStatistics& style,
                       const WhiteningRule& rule, double strength = 1) {
  Apply(WhitenAndColor(MeasureFeatures(content), style, rule, strength), &content);
  return content;
}

FeatureStatistics Standard() {
  FeatureStatistics s{kChannels, std::vector<double>(kChannels),
                      std::vector<double>(kChannels * kChannels)};
  for (int c = 0; c < kChannels; ++c) s.covariance[c * kChannels + c] = 1;
  return s;
}

// Values are stored as floats: with values up to 10, 1e-6 each, and 1e-5 after the mean.
void ExpectNear(const FeatureStatistics& a, const FeatureStatistics& b, double tolerance) {
  for (size_t i = 0; i < a.mean.size(); ++i) EXPECT_NEAR(a.mean[i], b.mean[i], tolerance);
  for (size_t i = 0; i < a.covariance.size(); ++i)
    EXPECT_NEAR(a.covariance[i], b.covariance[i], tolerance);
}

TEST(FeatureTransform, WhitenedFeaturesHaveUnitCovariance) {
  ExpectNear(MeasureFeatures(Transformed(Features(1, 3, 2), Standard(), {0, 1e-5})), Standard(),
             1e-5);
}

TEST(FeatureTransform, ColouredFeaturesHaveTheStylesMeanAndCovariance) {
  const FeatureStatistics style = MeasureFeatures(Features(2, 5, -3));
  ExpectNear(MeasureFeatures(Transformed(Features(1, 3, 2), style, {0, 1e-5})), style, 1e-4);
}

TEST(FeatureTransform, ARidgeIsAddedOnBothSides) {
  // A (C + 1) A^T = S + 1, so the result's covariance is S + 1 - A A^T.
  const FeatureStatistics content = MeasureFeatures(Features(1, 3, 2)),
                          style = MeasureFeatures(Features(2, 5, -3));
  const FeatureAffine a = WhitenAndColor(content, style, {1, 1e-5});
  const int n = kChannels;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      double sum = 0;
      for (int k = 0; k < n; ++k)
        for (int l = 0; l < n; ++l)
          sum += a.matrix[i * n + k] * (content.covariance[k * n + l] + (k == l)) *
                 a.matrix[j * n + l];
      const double ridged = style.covariance[i * n + j] + (i == j);
      EXPECT_NEAR(sum, ridged,
                  testing::RecordDigits("covariance with a ridge", testing::Computed::kDouble,
                                        sum - ridged, 1e-12));
    }
}

TEST(FeatureTransform, H26_DirectionsWithoutFeaturesAreNeverBlownUp) {
  // Two of five directions vary, and float rounding leaves 1e-13 in the others.
  const FeatureStatistics style = MeasureFeatures(Features(2, 5, -3));
  for (const WhiteningRule rule : {WhiteningRule{0, 1e-5}, WhiteningRule{1, 1e-5}}) {
    const FeatureAffine a = WhitenAndColor(MeasureFeatures(Features(1, 3, 2, 2)), style, rule);
    for (const double v : a.matrix)
      EXPECT_LE(std::abs(v),
                testing::RecordBound("largest entry", testing::Computed::kDouble, v, 10));
  }
}

TEST(FeatureTransform, H26_ASingularCovarianceIsMadeRegularBeforeItsCholeskyFactor) {
  // Two channels are equal but for rounding: the second pivot is 4e-15. Divided by its root,
  // features would grow ten million times; with the ridge of 2e-5 at most by 1 / sqrt(4e-5).
  const FeatureStatistics content{2, {0, 0}, {1, 1 - 2e-15, 1 - 2e-15, 1}};
  const FeatureStatistics style{2, {0, 0}, {1, 0, 0, 1}};
  const FeatureAffine a = CholeskyColor(content, style);
  for (const double v : a.matrix)
    EXPECT_LE(std::abs(v),
              testing::RecordBound("largest entry", testing::Computed::kDouble, v, 200));
}

TEST(FeatureTransform, H6_AConstantPhotoTakesTheStylesMean) {
  const FeatureStatistics style = MeasureFeatures(Features(2, 5, -3));
  for (const WhiteningRule rule : {WhiteningRule{0, 1e-5}, WhiteningRule{1, 1e-5}}) {
    const FeatureMap result = Transformed(Features(1, 0, 2), style, rule);
    const FeatureStatistics got = MeasureFeatures(result);
    for (int c = 0; c < kChannels; ++c) {
      EXPECT_NEAR(got.mean[c], style.mean[c],
                  testing::RecordBound("the style's mean", testing::Computed::kFloat,
                                       got.mean[c] - style.mean[c], 1e-5));
      EXPECT_LE(got.covariance[c * kChannels + c], 1e-10);
    }
  }
}

TEST(FeatureTransform, H7_AGreyStyleFlattens) {
  // A style without variation: without a ridge nothing is left of the photo's.
  const FeatureStatistics style = MeasureFeatures(Features(2, 0, -3));
  const FeatureStatistics got =
      MeasureFeatures(Transformed(Features(1, 3, 2), style, {0, 1e-5}));
  ExpectNear(got, style, 1e-5);
  // A style that varies in one direction alone gives rank one.
  const FeatureStatistics line = MeasureFeatures(Features(2, 5, -3, 1));
  ExpectNear(MeasureFeatures(Transformed(Features(1, 3, 2), line, {0, 1e-5})), line, 1e-4);
}

TEST(FeatureTransform, StrengthMixesWithTheIdentity) {
  const FeatureStatistics style = MeasureFeatures(Features(2, 5, -3));
  const FeatureMap content = Features(1, 3, 2);
  const FeatureMap full = Transformed(content, style, {1, 1e-5}),
                   half = Transformed(content, style, {1, 1e-5}, 0.5),
                   none = Transformed(content, style, {1, 1e-5}, 0);
  for (size_t i = 0; i < content.values.size(); i += 97) {
    EXPECT_NEAR(half.values[i], (full.values[i] + content.values[i]) / 2, 1e-5);
    EXPECT_NEAR(none.values[i], content.values[i], 1e-5);
  }
}

TEST(FeatureTransform, H11_OnePixelHasNoCovariance) {
  FeatureMap pixel(kChannels, 1, 1);
  pixel.values = {1, 2, 3, 4, 5};
  for (const double v : MeasureFeatures(pixel, 1).covariance) EXPECT_EQ(v, 0);
}

}  // namespace
}  // namespace regrade
