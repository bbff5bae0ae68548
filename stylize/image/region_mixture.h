// Regions of pictures as a mixture of Gaussians over features of their pixels.
#pragma once

#include <cstdint>
#include <vector>

namespace regrade {

// Rows of `dimensions` numbers, one row for each pixel of a sample.
struct FeatureRows {
  int dimensions = 0;
  std::vector<float> values;  // [rows, dimensions]

  int64_t rows() const { return dimensions > 0 ? std::ssize(values) / dimensions : 0; }
};

struct RegionPart {
  double weight = 0;               // they sum to 1
  std::vector<double> mean;        // [dimensions]
  std::vector<double> covariance;  // [dimensions, dimensions], eigenvalues at least kPartFloor
};
using RegionMixture = std::vector<RegionPart>;

inline constexpr double kPartFloor = 0.02 * 0.02;

// EQ(gaussian-mixture) in more dimensions: expectation maximisation from k-means++ on `seed`,
// 60 iterations at most. Fewer than `parts` where the rows have fewer clusters wider than the
// floor. The same for any number of threads. There must be a row, all finite.
RegionMixture FitRegions(const FeatureRows& rows, int parts, uint64_t seed);

// [rows, parts]: the shares r_ik of EQ(gaussian-mixture); each row sums to 1.
std::vector<float> RegionShares(const RegionMixture& mixture, const FeatureRows& rows);

// Squared Wasserstein distance between two parts: c_kl of EQ(mixture-transport).
double PartDistance(const RegionPart& a, const RegionPart& b);

}  // namespace regrade
