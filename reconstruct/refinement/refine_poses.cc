#include "reconstruct/refinement/refine_poses.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <glog/logging.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/base/quantile.h"
#include "reconstruct/refinement/bundle.h"

namespace regrade {
namespace {

constexpr int64_t kFewestHeldOut = 100;  // for validation: gives the median to 10 %
constexpr int kMostIterations = 50;
constexpr double kLeastLossScale = 0.5;     // pixels
constexpr double kLossScaleOfMedian = 2;    // errors above twice the median are outliers
constexpr double kRayleighMedian = 1.1774;  // median length of a 2D normal vector, sigma 1

// Residual through the camera's own projection, with numeric derivatives, for all lenses.
struct ObservationError {
  const Camera* lens;
  const Mat3d* rotation;
  double u, v;

  bool operator()(const double* pose, const double* point, const double* focal,
                  double* residual) const {
    const Vec3d p =
        *rotation * Vec3d{point[0] - pose[3], point[1] - pose[4], point[2] - pose[5]};
    const double before[3] = {p.x, p.y, p.z};
    double rotated[3];
    ceres::AngleAxisRotatePoint(pose, before, rotated);
    double x = 0, y = 0;
    if (!lens->Project({rotated[0], rotated[1], rotated[2]}, &x, &y)) return false;
    const double factor = std::exp(*focal);
    residual[0] = (x - lens->cx) * factor + lens->cx - u;
    residual[1] = (y - lens->cy) * factor + lens->cy - v;
    return true;
  }
};

class ProgressCallback final : public ceres::IterationCallback {
 public:
  explicit ProgressCallback(const ProgressFunction& progress) : progress_(progress) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    aborted_ = Report(progress_, summary.iteration, kMostIterations, "adjusting the poses") ==
               LoopControl::kStop;
    return aborted_ ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }
  bool aborted() const { return aborted_; }

 private:
  ProgressFunction progress_;
  bool aborted_ = false;
};

// The parameters to adjust besides the points.
struct Freedom {
  bool poses = false, focal = false;
};

struct Gauge {
  size_t view = 0;      // its pose is fixed
  size_t far_view = 0;  // one coordinate of its centre is fixed
  int coordinate = 0;
};

Gauge ChooseGauge(const Bundle& bundle) {
  std::vector<int64_t> count(bundle.poses.size());
  for (const BundleObservation& observation : bundle.observations)
    count[observation.view] += !observation.held_out;
  Gauge gauge;
  gauge.view = static_cast<size_t>(std::ranges::max_element(count) - count.begin());
  double farthest = -1;
  for (size_t v = 0; v < bundle.poses.size(); ++v) {
    if (!bundle.adjustable[v]) continue;
    for (int i = 0; i < 3; ++i) {
      const size_t c = static_cast<size_t>(i) + 3;
      const double offset = std::abs(bundle.poses[v][c] - bundle.poses[gauge.view][c]);
      if (offset > farthest) farthest = offset, gauge.far_view = v, gauge.coordinate = i;
    }
  }
  return gauge;
}

class Adjustment {
 public:
  Adjustment(Bundle* bundle, Freedom freedom, double loss_scale)
      : bundle_(bundle), loss_(loss_scale), problem_(Ownership()) {
    for (const BundleObservation& s : bundle->observations) {
      if (s.held_out || !std::isfinite(ReprojectionError(*bundle, s))) continue;
      auto* const cost =
          new ceres::NumericDiffCostFunction<ObservationError, ceres::CENTRAL, 2, 6, 3, 1>(
              new ObservationError{&bundle->lenses[s.view], &bundle->rotations[s.view], s.u,
                                   s.v});
      double* const pose = bundle->poses[s.view].data();
      double* const point = bundle->points[s.point].data();
      double* const focal = &bundle->focal[bundle->camera[s.view]];
      problem_.AddResidualBlock(cost, &loss_, pose, point, focal);
      ordering_->AddElementToGroup(point, 0);  // eliminated
      ordering_->AddElementToGroup(pose, 1);
      ordering_->AddElementToGroup(focal, 1);
      if (!freedom.focal) problem_.SetParameterBlockConstant(focal);
      if (!freedom.poses || !bundle->adjustable[s.view])
        problem_.SetParameterBlockConstant(pose);
    }
    if (!freedom.poses) return;
    const Gauge gauge = ChooseGauge(*bundle);
    problem_.SetParameterBlockConstant(bundle->poses[gauge.view].data());
    if (gauge.far_view != gauge.view)
      problem_.SetManifold(bundle->poses[gauge.far_view].data(),
                           new ceres::SubsetManifold(6, {3 + gauge.coordinate}));
  }

  // False if Ceres finds no usable solution.
  bool Solve(bool points_alone, const ProgressFunction& progress) {
    ceres::Solver::Options options;
    options.linear_solver_type =
        points_alone ? ceres::SPARSE_NORMAL_CHOLESKY : ceres::SPARSE_SCHUR;
    if (!points_alone) options.linear_solver_ordering = ordering_;
    options.num_threads = 1;  // a fixed order of sums
    options.max_num_iterations = kMostIterations;
    options.function_tolerance = 1e-7;
    options.logging_type = ceres::SILENT;
    ProgressCallback callback(progress);
    options.callbacks = {&callback};
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    if (callback.aborted()) throw Interrupted();
    return summary.IsSolutionUsable();
  }

  // Medians of the standard errors of rotations (radians) and centres (bundle units), for
  // observations with this standard deviation in each coordinate; none if the covariance is
  // rank deficient.
  std::optional<std::pair<double, double>> StandardErrors(double deviation) {
    FLAGS_minloglevel = google::GLOG_FATAL;  // Ceres warns about rank deficiency
    ceres::Covariance::Options options;
    options.algorithm_type = ceres::SPARSE_QR;
    options.num_threads = 1;
    ceres::Covariance covariance(options);
    std::vector<std::pair<const double*, const double*>> blocks;
    for (std::array<double, 6>& pose : bundle_->poses)
      if (problem_.HasParameterBlock(pose.data()) &&
          !problem_.IsParameterBlockConstant(pose.data()))
        blocks.emplace_back(pose.data(), pose.data());
    if (blocks.empty() || !covariance.Compute(blocks, &problem_)) return std::nullopt;
    std::vector<double> rotations, centers;
    for (const auto& [pose, same] : blocks) {
      double block[36];
      if (!covariance.GetCovarianceBlock(pose, same, block)) return std::nullopt;
      rotations.push_back(deviation * std::sqrt(block[0] + block[7] + block[14]));
      centers.push_back(deviation * std::sqrt(block[21] + block[28] + block[35]));
    }
    return std::pair(Median(rotations), Median(centers));
  }

 private:
  static ceres::Problem::Options Ownership() {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  Bundle* bundle_;
  ceres::SoftLOneLoss loss_;
  ceres::Problem problem_;
  std::shared_ptr<ceres::ParameterBlockOrdering> ordering_ =
      std::make_shared<ceres::ParameterBlockOrdering>();
};

double LossScale(const Bundle& bundle) {
  const double median = MedianError(bundle, false);
  return std::isfinite(median) ? std::max(kLeastLossScale, kLossScaleOfMedian * median)
                               : kLeastLossScale;
}

// Medians of the differences between the refined and the given poses.
void MeasureCorrections(const ColmapModel& before, const ColmapModel& after, double per_extent,
                        PoseRefinement* result) {
  std::vector<double> turned, moved;
  for (size_t v = 0; v < before.images.size(); ++v) {
    const RigidTransform& old = before.images[v].camera_from_world;
    const RigidTransform& now = after.images[v].camera_from_world;
    const Mat3d turn = now.rotation * old.rotation.Transposed();
    // From the antisymmetric part, which is accurate for small angles.
    const Vec3d axis{turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1)};
    turned.push_back(std::atan2(Norm(axis), turn(0, 0) + turn(1, 1) + turn(2, 2) - 1) * 180 /
                     M_PI);
    moved.push_back(Norm(now.Inverse().translation - old.Inverse().translation) * per_extent);
  }
  result->turned_deg = Median(turned);
  result->moved_fraction = Median(moved);
}

std::string WhyRejected(const PoseRefinement& result, bool asked_for) {
  const double most = (asked_for ? 1 : 1 - kRefinementPays) * result.held_out_before_px;
  if (result.held_out_after_px < most) return "";
  return "held-out observations do not fit better";
}

}  // namespace

PoseRefinement RefinePoses(const ColmapModel& model, const RefinePosesOptions& options,
                           const ProgressFunction& progress) {
  PoseRefinement result;
  result.model = model;
  Bundle bundle = MakeBundle(model);
  result.observations = std::ssize(bundle.observations);
  for (const BundleObservation& s : bundle.observations) result.held_out += s.held_out;
  result.left_alone = static_cast<int>(std::ranges::count(bundle.adjustable, false));
  ProgressParts parts(progress, 4);
  const auto refuse = [&result](const std::string& why) {
    result.tried = true;
    result.refused = why;
    return result;
  };
  if (result.held_out < kFewestHeldOut || bundle.extent == 0) {
    result.misfit_px = MedianError(bundle, false);
    return options.asked_for ? refuse(bundle.extent == 0 ? "all cameras are at one place"
                                                         : "too few observations to validate")
                             : result;
  }
  // Adjusting the points can only reduce the error.
  result.misfit_px = MedianError(bundle, false);
  if (!options.asked_for && !(result.misfit_px > options.misfit_px)) return result;
  if (!Adjustment(&bundle, {}, LossScale(bundle)).Solve(true, parts.Next(1)))
    return refuse("the points could not be adjusted");
  result.misfit_px = MedianError(bundle, false);
  result.held_out_before_px = MedianError(bundle, true);
  if (!options.asked_for && !(result.misfit_px > options.misfit_px)) return result;

  result.tried = true;
  const Freedom freedom{true, options.free_focal};
  // First with a wide loss, then with one scaled to the remaining errors.
  if (!Adjustment(&bundle, freedom, LossScale(bundle)).Solve(false, parts.Next(1)))
    return refuse("the poses could not be adjusted");
  Adjustment last(&bundle, freedom, LossScale(bundle));
  if (!last.Solve(false, parts.Next(1))) return refuse("the poses could not be adjusted");
  result.refined_px = MedianError(bundle, false);
  result.held_out_after_px = MedianError(bundle, true);
  result.refused = WhyRejected(result, options.asked_for);
  if (!result.refused.empty()) return result;
  const ColmapModel refined = ModelOfBundle(bundle, model);
  MeasureCorrections(model, refined, bundle.bundle_from_world.scale, &result);
  if (const auto errors = last.StandardErrors(result.refined_px / kRayleighMedian)) {
    result.turn_error_deg = errors->first * 180 / M_PI;
    result.moved_error = errors->second;
  }
  parts.Next(1);
  result.model = refined;
  return result;
}

}  // namespace regrade
