#include "reconstruct/exposure_errors.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

constexpr double kNormalMad =
    1.4826;  // standard deviation over median absolute deviation, if normal

using Index = Eigen::Index;

// S = sum over points of diag(w) - w w^T / sum w: the normal matrix of the gains, the points'
// colours eliminated; the same for all channels, since an observation has one weight.
Eigen::MatrixXd NormalMatrix(const std::vector<WeightedResidual>& residuals, Index num_views,
                             size_t num_points) {
  std::vector<std::vector<const WeightedResidual*>> tracks(num_points);
  for (const WeightedResidual& r : residuals) tracks[r.point].push_back(&r);
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(num_views, num_views);
  for (const auto& track : tracks) {
    double sum = 0;
    for (const WeightedResidual* r : track) sum += r->weight;
    for (const WeightedResidual* r : track) {
      const auto row = static_cast<Index>(r->view);
      normal(row, row) += r->weight;
      for (const WeightedResidual* s : track)
        normal(row, static_cast<Index>(s->view)) -= r->weight * s->weight / sum;
    }
  }
  return normal;
}

// Diagonal of the pseudo-inverse of S. Its null space, a constant for each group, is filled
// before the inversion and taken out after it.
Eigen::VectorXd PseudoInverseDiagonal(Eigen::MatrixXd normal,
                                      const std::vector<size_t>& groups) {
  const Index n = normal.rows();
  const auto group = [&groups](Index v) { return groups[static_cast<size_t>(v)]; };
  std::vector<int> size(groups.size());
  for (const size_t number : groups) ++size[number];
  const double fill = std::max(normal.trace() / static_cast<double>(n), 1e-12);
  for (Index v = 0; v < n; ++v)
    for (Index u = 0; u < n; ++u)
      if (group(u) == group(v)) normal(v, u) += fill / size[group(v)];
  Eigen::VectorXd diagonal = normal.ldlt().solve(Eigen::MatrixXd::Identity(n, n)).diagonal();
  for (Index v = 0; v < n; ++v) diagonal(v) -= 1 / (fill * size[group(v)]);
  return diagonal.cwiseMax(0);
}

// How much larger the noise is than what the fit leaves of it: short tracks swallow much of
// their own.
double SwallowedNoise(const std::vector<WeightedResidual>& residuals, size_t num_views,
                      size_t num_points) {
  std::vector<bool> views(num_views), points(num_points);
  for (const WeightedResidual& r : residuals) views[r.view] = points[r.point] = true;
  const auto unknowns = std::count(views.begin(), views.end(), true) +
                        std::count(points.begin(), points.end(), true);
  const auto all = static_cast<double>(residuals.size());
  return std::sqrt(all / std::max(1.0, all - static_cast<double>(unknowns)));
}

}  // namespace

std::vector<Vec3d> LogGainErrors(const std::vector<WeightedResidual>& residuals,
                                 const std::vector<size_t>& groups, size_t num_points) {
  const Eigen::VectorXd variances = PseudoInverseDiagonal(
      NormalMatrix(residuals, static_cast<Index>(groups.size()), num_points), groups);
  const double swallowed = SwallowedNoise(residuals, groups.size(), num_points);
  std::vector<Vec3d> errors(groups.size());
  for (int c = 0; c < 3; ++c) {
    std::vector<double> sizes;
    for (const WeightedResidual& r : residuals) sizes.push_back(std::abs(r.value[c]));
    const double sigma = kNormalMad * MedianOf(std::move(sizes)) * swallowed;
    for (size_t v = 0; v < groups.size(); ++v)
      errors[v][c] = sigma * std::sqrt(variances(static_cast<Index>(v)));
  }
  return errors;
}

double MedianOf(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<long>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace regrade
