#include "pipeline/page/value_transform.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace regrade {

ValueTransform DecorrelatingTransform(const std::vector<float>& difference, int channels) {
  const int64_t n = static_cast<int64_t>(difference.size()) / channels;
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(channels, channels);
  for (int64_t i = 0; i < n; ++i) {
    const float* const row = difference.data() + i * channels;
    for (int a = 0; a < channels; ++a)
      for (int b = 0; b <= a; ++b) covariance(a, b) += static_cast<double>(row[a]) * row[b];
  }
  for (int a = 0; a < channels; ++a)
    for (int b = a + 1; b < channels; ++b) covariance(a, b) = covariance(b, a);
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
  solver.compute(covariance);
  ValueTransform transform{channels,
                           std::vector<double>(static_cast<size_t>(channels) * channels)};
  for (int k = 0; k < channels; ++k)  // the largest variance first
    for (int j = 0; j < channels; ++j)
      transform.matrix[static_cast<size_t>(k) * channels + j] =
          std::round(solver.eigenvectors()(j, channels - 1 - k) * 1e6) / 1e6;
  return transform;
}

}  // namespace regrade
