// First and second moments of a network's features over the positions of pictures, and two
// distances between them.
#pragma once

#include <cstdint>
#include <vector>

namespace regrade {

// Mean and scatter of feature vectors; pictures may differ in size.
class FeatureStatistics {
 public:
  // `features` [channels, positions] of one picture; in two passes, in double.
  FeatureStatistics(const std::vector<float>& features, int channels);
  FeatureStatistics() = default;

  // As if all positions had been in one picture (parallel axis theorem). An empty one takes
  // over the other; else the channels must be the same.
  FeatureStatistics& operator+=(const FeatureStatistics& o);

  int channels() const { return static_cast<int>(mean_.size()); }
  int64_t count() const { return count_; }

 private:
  friend double GramDistance(const FeatureStatistics&, const FeatureStatistics&);
  friend double FrechetDistance(const FeatureStatistics&, const FeatureStatistics&);

  std::vector<double> mean_;     // [C]
  std::vector<double> scatter_;  // [C, C]: sum (f - mean) (f - mean)^T
  int64_t count_ = 0;
};

// EQ(gram-distance), Gatys et al. 2016, one layer of their style loss: sum_ij (G_ij - A_ij)^2 /
// (4 C^2), G = sum_x f(x) f(x)^T / n over the n positions of one picture's features, A of the
// other's. As theirs where pictures have one size: they divide the sum by n^2 instead.
double GramDistance(const FeatureStatistics& a, const FeatureStatistics& b);

// EQ(frechet-distance), Dowson and Landau 1982; of features Heusel et al. 2017 (FID):
// |m_a - m_b|^2 + tr(S_a) + tr(S_b) - 2 tr((S_a S_b)^(1/2)), means m and covariances S over n.
// The last trace is that of (R S_b R)^(1/2), R = S_a^(1/2), eigenvalues below 0 as 0. At least
// 0.
double FrechetDistance(const FeatureStatistics& a, const FeatureStatistics& b);

}  // namespace regrade
