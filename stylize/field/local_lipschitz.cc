#include "stylize/field/local_lipschitz.h"

#include <Eigen/Core>
#include <algorithm>
#include <utility>
#include <vector>

#include "kernels/base/parallel_tasks.h"
#include "kernels/base/random.h"
#include "stylize/spectral_norm.h"

namespace regrade {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// f in double, with the network's matrices at hand.
class Steepness {
 public:
  explicit Steepness(const LipschitzNetwork& network)
      : data_(network.data()), network_(network.Effective<double>()) {
    const int basis = data_.basis;
    base_ = MatrixXd::Zero(network.row().sh(), network.row().inputs());
    if (!data_.has_base) return;
    for (int c = 0; c < 3; ++c)
      for (int d = 0; d < 3; ++d)
        for (int k = 0; k < basis; ++k)
          base_(c * basis + k, d * basis + k) = data_.base.matrix(c, d);
  }

  // Columns are points. The base's offset is left out: it cancels in every difference.
  MatrixXd Forward(const MatrixXd& points) const {
    MatrixXd x = points;
    for (size_t l = 0; l < network_.layers.size(); ++l) {
      x = (Weight(l) * x).colwise() + Bias(l);
      if (l + 1 < network_.layers.size())
        x = x.unaryExpr(
            [&](double v) { return Activate(network_.activation, network_.omega, v); });
    }
    return x + base_ * points;
  }

  MatrixXd Jacobian(const VectorXd& point) const {
    MatrixXd jacobian = MatrixXd::Identity(point.size(), point.size());
    VectorXd x = point;
    for (size_t l = 0; l < network_.layers.size(); ++l) {
      const VectorXd sum = Weight(l) * x + Bias(l);
      jacobian = Weight(l) * jacobian;
      if (l + 1 == network_.layers.size()) break;
      for (int i = 0; i < sum.size(); ++i)
        jacobian.row(i) *= ActivateDerivative(network_.activation, network_.omega, sum(i));
      x = sum.unaryExpr(
          [&](double v) { return Activate(network_.activation, network_.omega, v); });
    }
    return jacobian + base_;
  }

  // The Jacobian times a direction, without its other columns.
  VectorXd Along(const VectorXd& point, const VectorXd& direction) const {
    VectorXd moved = direction, x = point;
    for (size_t l = 0; l < network_.layers.size(); ++l) {
      const VectorXd sum = Weight(l) * x + Bias(l);
      moved = Weight(l) * moved;
      if (l + 1 == network_.layers.size()) break;
      for (int i = 0; i < sum.size(); ++i)
        moved(i) *= ActivateDerivative(network_.activation, network_.omega, sum(i));
      x = sum.unaryExpr(
          [&](double v) { return Activate(network_.activation, network_.omega, v); });
    }
    return moved + base_ * direction;
  }

  // ||J||_2 by the power iteration on J^T J: a lower bound, so it never exceeds the
  // network's own constant. `direction` [inputs] is where it starts and ends.
  double NormAt(const VectorXd& point, VectorXd* direction) const {
    const MatrixXd jacobian = Jacobian(point);
    double norm = 0;
    for (int i = 0; i < 30; ++i) {
      const VectorXd image = jacobian * *direction;
      norm = image.norm();
      const VectorXd next = jacobian.transpose() * image;
      if (!(next.norm() > 0)) break;
      *direction = next.normalized();
    }
    return norm;
  }

 private:
  Eigen::Map<const RowMajor> Weight(size_t l) const {
    const auto& layer = network_.layers[l];
    return {layer.weight.data(), layer.outputs, layer.inputs};
  }
  Eigen::Map<const VectorXd> Bias(size_t l) const {
    return {network_.layers[l].bias.data(), network_.layers[l].outputs};
  }

  const LipschitzNetworkData& data_;
  DenseNetwork<double> network_;
  MatrixXd base_;
};

}  // namespace

LocalLipschitz MeasureLocalLipschitz(const LipschitzNetwork& network,
                                     const RadianceField& field,
                                     const LocalLipschitzOptions& options) {
  LocalLipschitz result;
  const int64_t n = field.geometry->num_voxels();
  if (n == 0) return result;
  const Steepness f(network);
  const NetworkRow row = network.row();
  const int inputs = row.inputs();
  const std::vector<int32_t> vertex = VertexOfVoxel(*field.geometry);
  const auto point_of = [&](uint64_t stream, int64_t i) {
    const int64_t voxel = static_cast<int64_t>(
        RandomIndex(options.seed, stream, static_cast<uint64_t>(i), static_cast<uint64_t>(n)));
    float values[kLargestRow.stride()];
    FillFeatures(field, network.data().position_scale, voxel, vertex[voxel], values);
    VectorXd point(inputs);
    for (int k = 0; k < inputs; ++k) point(k) = values[k];
    return point;
  };

  constexpr int64_t kChunk = 500;
  std::vector<double> pairs(static_cast<size_t>((options.pairs + kChunk - 1) / kChunk));
  ParallelTasks(0, std::ssize(pairs), [&](int64_t chunk) {
    const int64_t begin = chunk * kChunk, count = std::min(kChunk, options.pairs - begin);
    MatrixXd a(inputs, count), b(inputs, count);
    for (int64_t i = 0; i < count; ++i) {
      a.col(i) = point_of(1, begin + i);
      b.col(i) = point_of(2, begin + i);
    }
    const MatrixXd difference = f.Forward(a) - f.Forward(b);
    for (int64_t i = 0; i < count; ++i) {
      const double distance = (a.col(i) - b.col(i)).norm();
      double& steepest = pairs[static_cast<size_t>(chunk)];
      if (distance >= options.min_distance)
        steepest = std::max(steepest, difference.col(i).norm() / distance);
    }
  });
  for (const double steepest : pairs) result.pairs = std::max(result.pairs, steepest);

  std::vector<std::pair<double, VectorXd>> steepest(static_cast<size_t>(options.jacobians));
  ParallelTasks(0, options.jacobians, [&](int64_t i) {
    const VectorXd point = point_of(3, i);
    VectorXd direction = VectorXd::Ones(inputs).normalized();
    const double norm = f.NormAt(point, &direction);
    steepest[static_cast<size_t>(i)] = {norm, point};
  });
  std::ranges::sort(steepest, [](const auto& a, const auto& b) { return a.first > b.first; });
  if (!steepest.empty()) {
    result.jacobians = steepest.front().first;
    const MatrixXd jacobian = f.Jacobian(steepest.front().second);
    const auto norm = [](const RowMajor& m) {
      return SpectralNorm({m.data(), m.data() + m.size()}, static_cast<int>(m.rows()),
                          static_cast<int>(m.cols()));
    };
    result.along_coefficients = norm(jacobian.leftCols(row.sh()));
    result.along_position = norm(jacobian.rightCols(inputs - row.sh()));
  }

  // Gradient ascent: finite differences of the norm, steps of shrinking length along them.
  result.ascent = result.jacobians;
  const size_t starts = std::min<size_t>(4, steepest.size());
  for (size_t s = 0; s < starts; ++s) {
    VectorXd point = steepest[s].second;
    double best = steepest[s].first, step = 0.2;
    VectorXd direction = VectorXd::Ones(inputs).normalized();
    for (int i = 0; i < options.ascent_steps; ++i) {
      f.NormAt(point, &direction);
      VectorXd gradient(inputs);
      const VectorXd frozen = direction;
      constexpr double kH = 1e-5;
      for (int k = 0; k < inputs; ++k) {
        VectorXd plus = point, minus = point;
        plus(k) += kH, minus(k) -= kH;
        gradient(k) = (f.Along(plus, frozen).norm() - f.Along(minus, frozen).norm()) / (2 * kH);
      }
      if (!(gradient.norm() > 0)) break;
      const VectorXd next = point + step * gradient.normalized();
      const double norm = f.NormAt(next, &direction);
      if (norm > best) {
        best = norm;
        point = next;
      } else {
        step /= 2;
      }
    }
    result.ascent = std::max(result.ascent, best);
    f.NormAt(point, &direction);
    MatrixXd ends(inputs, 2);
    ends << point - 0.5 * options.min_distance * direction,
        point + 0.5 * options.min_distance * direction;
    const MatrixXd images = f.Forward(ends);
    result.steepest_pair =
        std::max(result.steepest_pair,
                 (images.col(1) - images.col(0)).norm() / (ends.col(1) - ends.col(0)).norm());
  }
  return result;
}

}  // namespace regrade
