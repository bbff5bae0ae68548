#include "stylize/image/mixture_transport.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/image/color_table.h"
#include "stylize/image/transport_plan.h"

namespace regrade {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d ToEigen(const Mat3d& m) {
  Matrix3d result;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) result(i, j) = m(i, j);
  return result;
}

// Of a positive definite matrix: eigenvalues to the power.
Matrix3d Power(const Matrix3d& m, double power) {
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(0.5 * (m + m.transpose()));
  const Vector3d values = solver.eigenvalues().cwiseMax(0.0).array().pow(power).matrix();
  return solver.eigenvectors() * values.asDiagonal() * solver.eigenvectors().transpose();
}

// The linear parts T_kl of one source part, and their costs.
struct PartMaps {
  std::vector<Matrix3d> linear;
  std::vector<double> cost;
};

PartMaps MapsOf(const GaussianPart& part, const GaussianMixture& style) {
  const Matrix3d s = ToEigen(part.covariance);
  const Matrix3d root = Power(s, 0.5), inverse = Power(s, -0.5);
  PartMaps maps;
  for (const GaussianPart& target : style) {
    const Matrix3d r = ToEigen(target.covariance);
    const Matrix3d inner = Power(root * r * root, 0.5);
    const Matrix3d a = inverse * inner * inverse;
    maps.linear.push_back(0.5 * (a + a.transpose()));
    const Vec3d d = part.mean - target.mean;
    maps.cost.push_back(std::max(0.0, Dot(d, d) + s.trace() + r.trace() - 2 * inner.trace()));
  }
  return maps;
}

ColorMap MeanMap(const GaussianPart& part, const GaussianMixture& style, const PartMaps& maps,
                 const std::vector<double>& plan) {
  double sum = 0;
  for (const double weight : plan) sum += weight;
  Matrix3d matrix = Matrix3d::Zero();
  Vec3d offset{};
  for (size_t l = 0; l < style.size(); ++l) {
    const double weight = plan[l] / sum;
    matrix += weight * maps.linear[l];
    offset += style[l].mean * weight;
  }
  ColorMap map;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) map.matrix(i, j) = matrix(i, j);
  map.offset = offset - map.matrix * part.mean;
  return map;
}

double SlopeOf(const MixtureMap& map, double enough) {
  return SteepestSlope(TabulateColors(kSlopeTable, std::cref(map)), enough);
}

}  // namespace

Vec3d MixtureMap::operator()(const Vec3d& color) const {
  double shares[kMostParts];
  SharesOf(densities, color, shares);
  Vec3d result{};
  for (size_t k = 0; k < maps.size(); ++k)
    if (shares[k] > 0) result += maps[k](color) * shares[k];
  return result;
}

MixtureMap ComputeMixtureMap(const GaussianMixture& source, const GaussianMixture& style,
                             double max_slope, double height_weight) {
  REGRADE_CHECK(!source.empty() && source.size() <= kMostParts && !style.empty() &&
                style.size() <= kMostParts && max_slope > 0);
  constexpr double kStep = 1.25;  // of the eigenvalues, from one trial to the next
  std::vector<PartMaps> maps;
  std::vector<std::vector<double>> cost;
  std::vector<double> from, to;
  for (const GaussianPart& part : source) {
    maps.push_back(MapsOf(part, style));
    cost.push_back(maps.back().cost);
    for (size_t l = 0; l < style.size(); ++l) {
      const double apart = height_weight * (part.height - style[l].height);
      cost.back()[l] += apart * apart;
    }
    from.push_back(part.weight);
  }
  for (const GaussianPart& part : style) to.push_back(part.weight);
  const std::vector<std::vector<double>> plan = TransportPlan(from, to, cost);

  MixtureMap map;
  map.densities = DensitiesOf(source, 0);
  for (size_t k = 0; k < source.size(); ++k)
    map.maps.push_back(MeanMap(source[k], style, maps[k], plan[k]));
  map.slope = map.slope_before = SlopeOf(map, max_slope);
  if (map.slope <= max_slope) return map;

  GaussianMixture widened = source;
  for (size_t k = 0; k < source.size(); ++k) {
    double least = kPartVarianceFloor;
    while (SpectralNorm(map.maps[k].matrix) > 0.8 * max_slope) {
      widened[k].covariance = WidenedCovariance(source[k].covariance, least *= kStep);
      map.maps[k] = MeanMap(widened[k], style, MapsOf(widened[k], style), plan[k]);
    }
  }
  const auto widen_shares = [&](double least) {
    map.densities = DensitiesOf(widened, least);
    map.slope = SlopeOf(map, max_slope);
    return map.slope <= max_slope;
  };
  // At the widest, the shares are constant, and the map is a mean of those above.
  constexpr double kWidest = 1e4;
  double below = kPartVarianceFloor, enough = below;
  while (!widen_shares(enough) && enough < kWidest) below = std::exchange(enough, 4 * enough);
  while (enough > kStep * below) {
    const double middle = std::sqrt(below * enough);
    (widen_shares(middle) ? enough : below) = middle;
  }
  widen_shares(enough);
  return map;
}

}  // namespace regrade
