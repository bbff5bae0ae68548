#include "stylize/linear_map.h"

#include <Eigen/Dense>
#include <algorithm>

#include "kernels/base/error.h"

namespace regrade {

Appearance ApplyColorMap(const Appearance& appearance, const ColorMap& map) {
  Appearance result = appearance;
  const int64_t voxels = appearance.sh.size() / appearance.stride();
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < voxels; ++i) {
    float* sh = &result.sh[i * result.stride()];
    MapCoefficients(map, result.basis, sh, sh);
  }
  const int64_t texels = appearance.sphere_color.size() / 3;
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < texels; ++i) {
    float* color = &result.sphere_color[3 * i];
    MapCoefficients(map, 1, color, color);
  }
  return result;
}

Vec3f MapBackground(const ColorMap& map, const Vec3f& background) {
  Vec3d mapped = map(background.Cast<double>());
  for (int c = 0; c < 3; ++c) mapped[c] = std::clamp(mapped[c], 0.0, 1.0);
  return mapped.Cast<float>();
}

double SpectralNorm(const Mat3d& m) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> matrix(&m.row[0].x);
  REGRADE_CHECK(matrix.allFinite());
  return matrix.jacobiSvd().singularValues()(0);
}

void LeastSquaresAccumulator::Add(const Vec3d& source, const Vec3d& target, double weight,
                                  double opacity) {
  const double x[4] = {source.x, source.y, source.z, opacity};
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) gram_[i][j] += weight * x[i] * x[j];
    for (int c = 0; c < 3; ++c) right_[i][c] += weight * x[i] * target[c];
  }
}

LeastSquaresAccumulator& LeastSquaresAccumulator::operator+=(const LeastSquaresAccumulator& o) {
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) gram_[i][j] += o.gram_[i][j];
    for (int c = 0; c < 3; ++c) right_[i][c] += o.right_[i][c];
  }
  return *this;
}

ColorMap LeastSquaresAccumulator::Solve() const {
  Eigen::Matrix4d gram;
  Eigen::Matrix<double, 4, 3> right;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) gram(i, j) = gram_[i][j];
    for (int c = 0; c < 3; ++c) right(i, c) = right_[i][c];
  }
  REGRADE_CHECK(gram.allFinite() && right.allFinite());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(gram);
  REGRADE_CHECK(solver.info() == Eigen::Success);
  const Eigen::Vector4d values = solver.eigenvalues();
  // Long sums leave up to 1e-11 of the largest eigenvalue as noise: what is not clearly above
  // that is no direction of the sources, and gets slope 0.
  Eigen::Vector4d inverse;
  for (int i = 0; i < 4; ++i) inverse(i) = values(i) > 1e-10 * values(3) ? 1 / values(i) : 0;
  const Eigen::Matrix<double, 4, 3> solution = solver.eigenvectors() * inverse.asDiagonal() *
                                               (solver.eigenvectors().transpose() * right);
  ColorMap map;
  for (int c = 0; c < 3; ++c) {
    for (int i = 0; i < 3; ++i) map.matrix(c, i) = solution(i, c);
    map.offset[c] = solution(3, c);
  }
  return map;
}

}  // namespace regrade
