#include "evaluate/flow_parallax.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/base/quantile.h"

namespace regrade {
namespace {

constexpr int kPointsAcross = 24;  // of the grid, along the longer side
constexpr size_t kLeastPoints = 16;
constexpr int kParallaxIterations = 12;
// Distances below, in pixels, count alike, and a ridge keeps the normal equations solvable.
constexpr double kLeastDistance = 0.02, kRidge = 1e-6;

using Coefficients = Eigen::Matrix<double, 8, 1>;

struct Point {
  double x, y;  // from the centre, in halves of the longer side
  double u, v;  // pixels
  Coefficients RowU() const {
    return (Coefficients() << 1, x, y, 0, 0, 0, x * x, x * y).finished();
  }
  Coefficients RowV() const {
    return (Coefficients() << 0, 0, 0, 1, x, y, x * y, y * y).finished();
  }
  double DistanceTo(const Coefficients& turn) const {
    return std::hypot(u - RowU().dot(turn), v - RowV().dot(turn));
  }
};

std::vector<Point> GridPoints(const FlowField& flow) {
  std::vector<Point> points;
  const int side = std::max(flow.width, flow.height);
  const int step = std::max(1, side / kPointsAcross);
  for (int y = step / 2; y < flow.height; y += step)
    for (int x = step / 2; x < flow.width; x += step) {
      const float* uv = flow.at(x, y);
      if (std::isfinite(uv[0]) && std::isfinite(uv[1]))
        points.push_back(
            {(2.0 * x - flow.width) / side, (2.0 * y - flow.height) / side, uv[0], uv[1]});
    }
  return points;
}

// Iteratively reweighted least squares.
Coefficients FitTurn(const std::vector<Point>& points) {
  Coefficients turn = Coefficients::Zero();
  for (int iteration = 0; iteration < kParallaxIterations; ++iteration) {
    Eigen::Matrix<double, 8, 8> normal = kRidge * Eigen::Matrix<double, 8, 8>::Identity();
    Coefficients right = Coefficients::Zero();
    for (const Point& point : points) {
      const double weight =
          iteration == 0 ? 1 : 1 / std::max(point.DistanceTo(turn), kLeastDistance);
      const Coefficients u = point.RowU(), v = point.RowV();
      normal += weight * (u * u.transpose() + v * v.transpose());
      right += weight * (point.u * u + point.v * v);
    }
    turn = normal.ldlt().solve(right);
  }
  return turn;
}

}  // namespace

FlowMotion MeasureFlowMotion(const FlowField& flow) {
  const std::vector<Point> points = GridPoints(flow);
  if (points.size() < kLeastPoints) return {};
  const Coefficients turn = FitTurn(points);
  std::vector<double> motion, parallax;
  for (const Point& point : points) {
    motion.push_back(std::hypot(point.u, point.v));
    parallax.push_back(point.DistanceTo(turn));
  }
  return {Quantile(motion, 0.5), Quantile(parallax, 0.75)};
}

}  // namespace regrade
