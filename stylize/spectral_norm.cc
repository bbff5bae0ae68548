#include "stylize/spectral_norm.h"

#include <Eigen/SVD>

namespace regrade {

double SpectralNorm(const std::vector<double>& matrix, int rows, int columns) {
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>
      map(matrix.data(), rows, columns);
  return Eigen::JacobiSVD<Eigen::MatrixXd>(map).singularValues()(0);
}

}  // namespace regrade
