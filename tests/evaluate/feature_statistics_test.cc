// Moments of features, and the distances between them against their definitions.
#include "evaluate/feature_statistics.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"

namespace regrade {
namespace {

// [channels, positions], correlated and of different spread.
std::vector<float> Features(int channels, int positions, uint64_t seed) {
  std::vector<float> features(static_cast<size_t>(channels) * positions);
  for (int c = 0; c < channels; ++c)
    for (int x = 0; x < positions; ++x) {
      const double own = RandomDouble(seed, c, x), shared = RandomDouble(seed, 99, x);
      features[static_cast<size_t>(c) * positions + x] =
          static_cast<float>((1 + 0.3 * c) * own + 0.4 * shared - 0.1 * c);
    }
  return features;
}

Eigen::MatrixXd AsMatrix(const std::vector<float>& features, int channels) {
  Eigen::MatrixXd m(channels, features.size() / channels);
  for (int c = 0; c < channels; ++c)
    for (int x = 0; x < m.cols(); ++x) m(c, x) = features[c * m.cols() + x];
  return m;
}

TEST(FeatureStatistics, GramDistanceAgreesWithItsDefinition) {
  const std::vector<float> a = Features(5, 60, 1), b = Features(5, 35, 2);  // sizes differ
  const Eigen::MatrixXd ma = AsMatrix(a, 5), mb = AsMatrix(b, 5);
  const double expected =
      (ma * ma.transpose() / 60 - mb * mb.transpose() / 35).squaredNorm() / (4 * 25);
  const FeatureStatistics sa(a, 5), sb(b, 5);
  EXPECT_NEAR(GramDistance(sa, sb), expected, 1e-12 * expected);  // sums in double
  EXPECT_EQ(GramDistance(sa, sa), 0);
}

TEST(FeatureStatistics, PartsArePooledAsOnePicture) {
  const std::vector<float> all = Features(4, 90, 3);
  std::vector<float> first, second;
  for (int c = 0; c < 4; ++c) {
    first.insert(first.end(), all.begin() + 90 * c, all.begin() + 90 * c + 25);
    second.insert(second.end(), all.begin() + 90 * c + 25, all.begin() + 90 * (c + 1));
  }
  FeatureStatistics parts;
  parts += FeatureStatistics(first, 4);
  parts += FeatureStatistics(second, 4);
  parts += FeatureStatistics();
  const FeatureStatistics whole(all, 4);
  EXPECT_EQ(parts.count(), 90);
  // Both distances see mean and covariance; values are of order 1.
  EXPECT_NEAR(GramDistance(parts, whole), 0, 1e-24);
  EXPECT_NEAR(FrechetDistance(parts, whole), 0, 1e-12);
}

TEST(FeatureStatistics, FrechetDistanceAgreesWithItsDefinition) {
  const std::vector<float> a = Features(6, 200, 4), b = Features(6, 150, 5);
  const auto moments = [](const Eigen::MatrixXd& m) {
    const Eigen::VectorXd mean = m.rowwise().mean();
    const Eigen::MatrixXd centred = m.colwise() - mean;
    return std::pair{mean, Eigen::MatrixXd(centred * centred.transpose() / m.cols())};
  };
  const auto [mean_a, of_a] = moments(AsMatrix(a, 6));
  const auto [mean_b, of_b] = moments(AsMatrix(b, 6));
  // The product is not symmetric; its eigenvalues are those of the symmetric form.
  const Eigen::EigenSolver<Eigen::MatrixXd> product(of_a * of_b);
  double roots = 0;
  for (const auto& value : product.eigenvalues())
    roots += std::sqrt(std::max(0.0, value.real()));
  const double expected =
      (mean_a - mean_b).squaredNorm() + of_a.trace() + of_b.trace() - 2 * roots;
  EXPECT_GT(expected, 0.01);
  EXPECT_NEAR(FrechetDistance(FeatureStatistics(a, 6), FeatureStatistics(b, 6)), expected,
              1e-9);  // two eigensystems in double
}

// More channels than positions: the covariance has directions without spread, which rounding
// makes negative.
TEST(FeatureStatistics, FewPositionsLeaveTheDistanceFinite) {
  const std::vector<float> a = Features(12, 5, 6), b = Features(12, 4, 7);
  const FeatureStatistics sa(a, 12), sb(b, 12);
  EXPECT_TRUE(std::isfinite(FrechetDistance(sa, sb)));
  // The root of rounding, 1e-16, is 1e-8, once a direction.
  EXPECT_NEAR(FrechetDistance(sa, sa), 0, 1e-6);
  EXPECT_NEAR(FrechetDistance(sa, sb), FrechetDistance(sb, sa), 1e-6);
  // A single position has no spread: the distance of the means is left.
  const FeatureStatistics p({1, 2}, 2), q({4, 6}, 2);
  EXPECT_DOUBLE_EQ(FrechetDistance(p, q), 25);
}

}  // namespace
}  // namespace regrade
