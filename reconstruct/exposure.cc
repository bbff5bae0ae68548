#include "reconstruct/exposure.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>

#include "kernels/base/error.h"
#include "reconstruct/exposure_errors.h"

namespace regrade {
namespace {

// Colours of one point differ by a few percent between photos for the texture beside it and the
// lens; what differs by much more than this is another surface, or a highlight.
constexpr double kLossScale = 0.05;

using Logs = std::vector<std::array<double, 3>>;

struct Sighting {
  size_t view, point;
  std::array<double, 3> log_light;
};

// Those of points that two photos see at least, in photos that have enough of them; each rule
// may undo the other, so until nothing changes.
std::vector<Sighting> UsefulSightings(size_t num_views,
                                      const std::vector<ColorObservation>& observations,
                                      size_t* num_points) {
  std::vector<Sighting> useful;
  for (const ColorObservation& o : observations) {
    REGRADE_CHECK(o.view >= 0 && static_cast<size_t>(o.view) < num_views && o.point >= 0);
    *num_points = std::max(*num_points, static_cast<size_t>(o.point) + 1);
    useful.push_back({static_cast<size_t>(o.view),
                      static_cast<size_t>(o.point),
                      {std::log(o.light.x), std::log(o.light.y), std::log(o.light.z)}});
  }
  for (size_t before = useful.size() + 1; useful.size() < before;) {
    before = useful.size();
    std::vector<int> of_view(num_views), of_point(*num_points);
    for (const Sighting& s : useful) ++of_view[s.view], ++of_point[s.point];
    std::erase_if(useful, [&](const Sighting& s) {
      return of_point[s.point] < 2 || of_view[s.view] < kFewestColors;
    });
  }
  return useful;
}

// log c - b - a; linear, so its Jacobians are constant.
class LogLightResidual final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  explicit LogLightResidual(const std::array<double, 3>& log_light) : log_light_(log_light) {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    for (size_t c = 0; c < 3; ++c)
      residuals[c] = log_light_[c] - parameters[0][c] - parameters[1][c];
    for (int block = 0; block < 2; ++block)
      if (jacobians && jacobians[block])
        for (int i = 0; i < 9; ++i) jacobians[block][i] = i % 4 == 0 ? -1 : 0;
    return true;
  }

 private:
  std::array<double, 3> log_light_;
};

// Photos that tracks tie together have one number, their least index; the others their own.
std::vector<size_t> Groups(size_t num_views, size_t num_points,
                           const std::vector<Sighting>& sightings) {
  std::vector<size_t> parent(num_views), first(num_points, num_views);
  std::iota(parent.begin(), parent.end(), size_t{0});
  const auto root = [&parent](size_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const Sighting& s : sightings) {
    if (first[s.point] == num_views) first[s.point] = s.view;
    const size_t a = root(s.view), b = root(first[s.point]);
    parent[std::max(a, b)] = std::min(a, b);
  }
  for (size_t v = 0; v < num_views; ++v) parent[v] = root(v);
  return parent;
}

// Least squares see no group's common gain: its first photo is held, and FixGauge() has the
// last word.
void Minimise(const std::vector<Sighting>& sightings, const std::vector<size_t>& groups,
              Logs* colors, Logs* gains) {
  ceres::SoftLOneLoss loss(kLossScale);
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  ceres::Solver::Options options;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (const Sighting& s : sightings) {
    double* const color = (*colors)[s.point].data();
    double* const gain = (*gains)[s.view].data();
    problem.AddResidualBlock(new LogLightResidual(s.log_light), &loss, color, gain);
    ordering->AddElementToGroup(color, 0);  // eliminated
    ordering->AddElementToGroup(gain, 1);
    if (groups[s.view] == s.view) problem.SetParameterBlockConstant(gain);
  }
  options.linear_solver_ordering = ordering;
  options.linear_solver_type = ceres::SPARSE_SCHUR;
  options.num_threads = 1;  // the same sums every time
  options.max_num_iterations = 200;
  // Where two photos disagree about a point by much more than the loss's scale, any colour
  // between is nearly as good, and the minimiser creeps there; the gains stand still long
  // before.
  options.function_tolerance = 1e-8;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  REGRADE_CHECK(summary.IsSolutionUsable());
}

// Moves each group's mean into the colours, where it belongs.
void FixGauge(const std::vector<size_t>& groups, const ExposureEstimate& estimate,
              Logs* gains) {
  Logs mean(groups.size());
  std::vector<int> count(groups.size());
  for (size_t v = 0; v < groups.size(); ++v) {
    if (!estimate.photos[v].known) continue;
    ++count[groups[v]];
    for (size_t c = 0; c < 3; ++c) mean[groups[v]][c] += (*gains)[v][c];
  }
  for (size_t v = 0; v < groups.size(); ++v)
    for (size_t c = 0; c < 3 && estimate.photos[v].known; ++c)
      (*gains)[v][c] -= mean[groups[v]][c] / count[groups[v]];
}

// What is left of each observation at the minimum, for the standard errors.
std::vector<WeightedResidual> Residuals(const std::vector<Sighting>& sightings,
                                        const Logs& colors, const Logs& gains) {
  std::vector<WeightedResidual> residuals;
  for (const Sighting& s : sightings) {
    WeightedResidual r{s.view, s.point, {}, 0};
    for (size_t c = 0; c < 3; ++c)
      r.value[static_cast<int>(c)] = s.log_light[c] - colors[s.point][c] - gains[s.view][c];
    r.weight = 1 / std::sqrt(1 + Dot(r.value, r.value) / (kLossScale * kLossScale));  // rho'
    residuals.push_back(r);
  }
  return residuals;
}

}  // namespace

double ExposureEstimate::Threshold() const {
  return std::max(kExposureSpread, kExposureErrors * median_error);
}

ExposureEstimate EstimateExposure(int num_views,
                                  const std::vector<ColorObservation>& observations) {
  ExposureEstimate estimate;
  estimate.photos.resize(static_cast<size_t>(num_views));
  size_t num_points = 0;
  const std::vector<Sighting> sightings =
      UsefulSightings(estimate.photos.size(), observations, &num_points);
  if (sightings.empty()) return estimate;

  Logs gains(estimate.photos.size()), colors(num_points);
  std::vector<int> sightings_of(num_points);
  for (const Sighting& s : sightings) {
    ++estimate.photos[s.view].observations;
    estimate.photos[s.view].known = true;
    ++sightings_of[s.point];
    for (size_t c = 0; c < 3; ++c)  // a running mean: where the minimiser begins
      colors[s.point][c] += (s.log_light[c] - colors[s.point][c]) / sightings_of[s.point];
  }
  const std::vector<size_t> groups = Groups(gains.size(), num_points, sightings);
  Minimise(sightings, groups, &colors, &gains);
  const std::vector<Vec3d> log_errors =
      LogGainErrors(Residuals(sightings, colors, gains), groups, num_points);
  FixGauge(groups, estimate, &gains);  // last: the residuals are those of the minimum

  double squares = 0;
  std::vector<double> errors;
  for (size_t v = 0; v < gains.size(); ++v)
    for (int c = 0; c < 3 && estimate.photos[v].known; ++c) {
      const double log_gain = gains[v][static_cast<size_t>(c)];
      estimate.photos[v].gain[c] = std::exp(log_gain);
      estimate.photos[v].log_error[c] = log_errors[v][c];
      squares += log_gain * log_gain;
      errors.push_back(log_errors[v][c]);
    }
  estimate.spread = std::sqrt(squares / static_cast<double>(errors.size()));
  estimate.median_error = MedianOf(errors);
  return estimate;
}

}  // namespace regrade
