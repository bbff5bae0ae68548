#include "reconstruct/refinement/exposure_model.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr double kSquaredScale = kExposureLossScale * kExposureLossScale;
// Reweighting steps: each removes more than half of the remaining error, and a thousandth of a
// gain is below its noise.
constexpr int kColorSteps = 20, kGainSteps = 60;
constexpr double kConverged = 1e-5;  // change of a log gain

using Index = Eigen::Index;

double Loss(const Vec3d& residual) {
  // rho(s) without the cancellation of its textbook form at small s.
  const double s = Dot(residual, residual);
  return 2 * s / (std::sqrt(1 + s / kSquaredScale) + 1);
}

// The group of each photo connected by tracks: the least index of its photos.
std::vector<size_t> GroupNumbers(size_t num_views, const ExposureData& data) {
  std::vector<size_t> parent(num_views);
  std::iota(parent.begin(), parent.end(), size_t{0});
  const auto root = [&parent](size_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (size_t p = 0; p + 1 < data.tracks.size(); ++p)
    for (size_t i = data.tracks[p] + 1; i < data.tracks[p + 1]; ++i) {
      const size_t a = root(data.observations[i].view);
      const size_t b = root(data.observations[data.tracks[p]].view);
      parent[std::max(a, b)] = std::min(a, b);
    }
  for (size_t v = 0; v < num_views; ++v) parent[v] = root(v);
  return parent;
}

// The weighted mean of a point's log colours at given gains.
Vec3d WeightedColor(const ExposureData& data, size_t point, const LogColors& gains,
                    const std::vector<double>& weights, double* sum) {
  Vec3d mean;
  *sum = 0;
  for (size_t i = data.tracks[point]; i < data.tracks[point + 1]; ++i) {
    const Observation& s = data.observations[i];
    mean += (s.log_light - gains[s.view]) * weights[i];
    *sum += weights[i];
  }
  return *sum > 0 ? mean / *sum : mean;
}

// Solves the normal equations of the gains with the points' colours eliminated: each point adds
// diag(w) - w w^T / sum w, the same for all channels, since an observation has one weight.
LogColors WeightedGains(const ExposureData& data, const std::vector<double>& weights,
                        size_t num_views) {
  const auto n = static_cast<Index>(num_views);
  const LogColors none(num_views);
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(n, n);
  Eigen::MatrixX3d right = Eigen::MatrixX3d::Zero(n, 3);
  for (size_t p = 0; p + 1 < data.tracks.size(); ++p) {
    double sum = 0;
    const Vec3d mean = WeightedColor(data, p, none, weights, &sum);
    for (size_t i = data.tracks[p]; i < data.tracks[p + 1] && sum > 0; ++i) {
      const Observation& s = data.observations[i];
      const auto row = static_cast<Index>(s.view);
      matrix(row, row) += weights[i];
      for (int c = 0; c < 3; ++c) right(row, c) += weights[i] * (s.log_light[c] - mean[c]);
      for (size_t j = data.tracks[p]; j < data.tracks[p + 1]; ++j)
        matrix(row, static_cast<Index>(data.observations[j].view)) -=
            weights[i] * weights[j] / sum;
    }
  }
  // A group's common gain is undetermined, and so is that of a photo whose observations are
  // left out: a small term on the diagonal keeps them near 0.
  matrix.diagonal().array() += 1e-9 * std::max(matrix.trace() / static_cast<double>(n), 1e-9);
  const Eigen::MatrixX3d solved = matrix.ldlt().solve(right);
  LogColors gains(num_views);
  for (size_t v = 0; v < num_views; ++v)
    for (int c = 0; c < 3; ++c) gains[v][c] = solved(static_cast<Index>(v), c);
  return gains;
}

// Shifts each group's mean to that of `reference`.
void FixMeans(const ExposureData& data, const std::vector<bool>& used,
              const LogColors& reference, LogColors* gains) {
  for (const std::vector<size_t>& group : data.members) {
    Vec3d shift;
    int count = 0;
    for (const size_t v : group)
      if (used[v]) shift += reference[v] - (*gains)[v], ++count;
    for (const size_t v : group)
      if (used[v]) (*gains)[v] += shift / count;
  }
}

}  // namespace

double ExposureWeight(const Vec3d& residual) {
  return 1 / std::sqrt(1 + Dot(residual, residual) / kSquaredScale);
}

double JackknifeError(const std::vector<double>& without) {
  const auto n = static_cast<double>(without.size());
  const double mean = std::accumulate(without.begin(), without.end(), 0.0) / n;
  double squares = 0;
  for (const double x : without) squares += (x - mean) * (x - mean);
  return std::sqrt((n - 1) / n * squares);
}

ExposureData ArrangeObservations(size_t num_views,
                                 const std::vector<ColorObservation>& observations) {
  ExposureData data;
  size_t num_points = 0;
  for (const ColorObservation& o : observations) {
    REGRADE_CHECK(o.view >= 0 && static_cast<size_t>(o.view) < num_views && o.point >= 0);
    REGRADE_CHECK(o.fold >= 0 && o.fold < kExposureFolds);
    num_points = std::max(num_points, static_cast<size_t>(o.point) + 1);
    data.observations.push_back(
        {static_cast<size_t>(o.view),
         static_cast<size_t>(o.point),
         {std::log(o.light.x), std::log(o.light.y), std::log(o.light.z)},
         o.radius2});
  }
  data.fold_of_point.resize(num_points);
  for (const ColorObservation& o : observations) data.fold_of_point[o.point] = o.fold;
  for (size_t before = data.observations.size() + 1; data.observations.size() < before;) {
    before = data.observations.size();
    std::vector<int> of_view(num_views), of_point(num_points);
    for (const Observation& s : data.observations) ++of_view[s.view], ++of_point[s.point];
    std::erase_if(data.observations, [&](const Observation& s) {
      return of_point[s.point] < 2 || of_view[s.view] < kFewestColors;
    });
  }
  std::ranges::sort(data.observations, [](const Observation& a, const Observation& b) {
    return a.point != b.point ? a.point < b.point : a.view < b.view;
  });
  data.tracks.resize(num_points + 1);
  data.known.resize(num_views);
  for (const Observation& s : data.observations)
    ++data.tracks[s.point + 1], data.known[s.view] = true;
  std::partial_sum(data.tracks.begin(), data.tracks.end(), data.tracks.begin());
  const std::vector<size_t> numbers = GroupNumbers(num_views, data);
  for (size_t v = 0; v < num_views; ++v) {
    if (!data.known[v] || numbers[v] != v) continue;
    data.members.emplace_back();
    for (size_t u = v; u < num_views; ++u)
      if (data.known[u] && numbers[u] == v) data.members.back().push_back(u);
  }
  return data;
}

Vec3d RobustColor(const ExposureData& data, size_t point, const LogColors& gains) {
  Vec3d color;
  const size_t begin = data.tracks[point], end = data.tracks[point + 1];
  for (int step = 0; step < kColorSteps; ++step) {
    Vec3d sum;
    double weights = 0;
    for (size_t i = begin; i < end; ++i) {
      const Vec3d seen = data.observations[i].log_light - gains[data.observations[i].view];
      const double w = step == 0 ? 1 : ExposureWeight(seen - color);
      sum += seen * w, weights += w;
    }
    const Vec3d next = sum / weights;
    const double moved = Norm(next - color);
    color = next;
    if (step > 0 && moved < kConverged) break;
  }
  return color;
}

LogColors ReweightedGains(const ExposureData& data, int without_fold, const LogColors& start) {
  std::vector<int> count(start.size());
  const auto left_out = [&](size_t p) { return data.fold_of_point[p] == without_fold; };
  for (const Observation& s : data.observations) count[s.view] += !left_out(s.point);
  std::vector<bool> used(start.size());
  LogColors gains(start.size());
  for (size_t v = 0; v < used.size(); ++v) {
    used[v] = count[v] >= kFewestColors;
    if (used[v]) gains[v] = start[v];
  }
  LogColors colors(data.fold_of_point.size());
  for (size_t p = 0; p < colors.size(); ++p)
    if (data.tracks[p] < data.tracks[p + 1]) colors[p] = RobustColor(data, p, gains);

  std::vector<double> weights(data.observations.size());
  for (int step = 0; step < kGainSteps; ++step) {
    for (size_t i = 0; i < weights.size(); ++i) {
      const Observation& s = data.observations[i];
      const bool counts = used[s.view] && !left_out(s.point);
      weights[i] = counts ? ExposureWeight(s.log_light - gains[s.view] - colors[s.point]) : 0;
    }
    LogColors next = WeightedGains(data, weights, gains.size());
    FixMeans(data, used, start, &next);
    double moved = 0;
    for (size_t v = 0; v < gains.size(); ++v) {
      if (!used[v]) next[v] = {};
      moved = std::max(moved, Norm(next[v] - gains[v]));
    }
    gains = next;
    double sum = 0;
    for (size_t p = 0; p < colors.size(); ++p)
      colors[p] = WeightedColor(data, p, gains, weights, &sum);
    if (moved < kConverged) break;
  }
  return gains;
}

std::vector<double> Disagreement(const ExposureData& data, const LogColors& gains) {
  std::vector<double> sums(kExposureFolds);
  for (size_t p = 0; p + 1 < data.tracks.size(); ++p) {
    if (data.tracks[p] == data.tracks[p + 1]) continue;
    const Vec3d color = RobustColor(data, p, gains);
    double& sum = sums[data.fold_of_point[p]];
    for (size_t i = data.tracks[p]; i < data.tracks[p + 1]; ++i) {
      const Observation& s = data.observations[i];
      sum += Loss(s.log_light - gains[s.view] - color);
    }
  }
  return sums;
}

}  // namespace regrade
