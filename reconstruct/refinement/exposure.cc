#include "reconstruct/refinement/exposure.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>

#include "kernels/base/error.h"
#include "kernels/base/quantile.h"
#include "reconstruct/refinement/exposure_model.h"

namespace regrade {
namespace {

// log c - b - a; linear, so its Jacobians are constant.
class LogLightResidual final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  explicit LogLightResidual(const Vec3d& log_light) : log_light_(log_light) {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    for (int c = 0; c < 3; ++c)
      residuals[c] = log_light_[c] - parameters[0][c] - parameters[1][c];
    for (int block = 0; block < 2; ++block)
      if (jacobians && jacobians[block])
        for (int i = 0; i < 9; ++i) jacobians[block][i] = i % 4 == 0 ? -1 : 0;
    return true;
  }

 private:
  Vec3d log_light_;
};

// A group's common gain is undetermined, so the gain of its first photo is fixed.
void Minimise(const ExposureData& data, LogColors* colors, LogColors* gains) {
  ceres::SoftLOneLoss loss(kExposureLossScale);
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  ceres::Solver::Options options;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (const Observation& s : data.observations) {
    double* const color = &(*colors)[s.point].x;
    double* const gain = &(*gains)[s.view].x;
    problem.AddResidualBlock(new LogLightResidual(s.log_light), &loss, color, gain);
    ordering->AddElementToGroup(color, 0);  // eliminated
    ordering->AddElementToGroup(gain, 1);
  }
  for (const std::vector<size_t>& group : data.members)
    problem.SetParameterBlockConstant(&(*gains)[group[0]].x);
  options.linear_solver_ordering = ordering;
  options.linear_solver_type = ceres::SPARSE_SCHUR;
  options.num_threads = 1;  // the same sums every time
  options.max_num_iterations = 50;
  // Where two photos disagree about a point by much more than the loss's scale, all colours in
  // between cost nearly the same, and the solver converges slowly there, long after the gains.
  options.function_tolerance = 1e-8;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  REGRADE_CHECK(summary.IsSolutionUsable());
}

// Shifts each group's log gains to mean 0.
void FixGauge(const ExposureData& data, LogColors* gains) {
  for (const std::vector<size_t>& group : data.members) {
    Vec3d sum;
    for (const size_t v : group) sum += (*gains)[v];
    for (const size_t v : group)
      (*gains)[v] += sum * (-1.0 / static_cast<double>(group.size()));
  }
}

LogColors BestGains(const ExposureData& data, size_t num_views) {
  // Reweighting approaches the minimum in a tenth of the time; Ceres finishes.
  LogColors gains = ReweightedGains(data, kNoFold, LogColors(num_views));
  LogColors colors(data.fold_of_point.size());
  for (size_t p = 0; p < colors.size(); ++p)
    if (data.tracks[p] < data.tracks[p + 1]) colors[p] = RobustColor(data, p, gains);
  Minimise(data, &colors, &gains);
  FixGauge(data, &gains);
  return gains;
}

// See EQ(exposure-pays).
void Explain(const std::vector<double>& before, const std::vector<double>& after,
             ExposureEstimate* estimate) {
  const double all_before = std::accumulate(before.begin(), before.end(), 0.0);
  const double all_after = std::accumulate(after.begin(), after.end(), 0.0);
  if (!(all_before > 0)) return;  // photos agree to the last bit
  estimate->explained = 1 - all_after / all_before;
  std::vector<double> without;
  for (size_t f = 0; f < before.size(); ++f)
    if (all_before - before[f] > 0)
      without.push_back(1 - (all_after - after[f]) / (all_before - before[f]));
  estimate->explained_error = JackknifeError(without);
}

}  // namespace

double ExposureEstimate::Threshold() const {
  return std::max(kExposurePays, kExposureSigmas * explained_error);
}

ExposureEstimate EstimateExposure(int num_views,
                                  const std::vector<ColorObservation>& observations) {
  ExposureEstimate estimate;
  estimate.photos.resize(num_views);
  const ExposureData data = ArrangeObservations(estimate.photos.size(), observations);
  if (data.observations.empty()) return estimate;
  const LogColors gains = BestGains(data, estimate.photos.size());

  std::vector<LogColors> without;
  std::vector<double> after(kExposureFolds);
  for (int fold = 0; fold < kExposureFolds; ++fold) {
    without.push_back(ReweightedGains(data, fold, gains));
    const auto f = static_cast<size_t>(fold);
    after[f] = Disagreement(data, without[f])[f];
  }
  Explain(Disagreement(data, LogColors(gains.size())), after, &estimate);

  for (const Observation& s : data.observations) ++estimate.photos[s.view].observations;
  double squares = 0;
  std::vector<double> errors;
  for (size_t v = 0; v < gains.size(); ++v) {
    PhotoExposure& photo = estimate.photos[v];
    photo.known = data.known[v];
    for (int c = 0; c < 3 && photo.known; ++c) {
      std::vector<double> logs;
      for (const LogColors& other : without) logs.push_back(other[v][c]);
      photo.gain[c] = std::exp(gains[v][c]);
      photo.log_error[c] = JackknifeError(logs);
      squares += gains[v][c] * gains[v][c];
      errors.push_back(photo.log_error[c]);
    }
  }
  estimate.spread = std::sqrt(squares / static_cast<double>(errors.size()));
  estimate.median_error = Median(std::move(errors));
  return estimate;
}

}  // namespace regrade
