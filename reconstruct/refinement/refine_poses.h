// Bundle-adjusts given poses and validates the result on held-out observations.
//
// COLMAP's mapper adjusts its own poses. Poses from other sources may be rounded, outdated, or
// measured without a camera.
#pragma once

#include <optional>
#include <string>

#include "kernels/base/progress.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// Poses are refined if the median reprojection error at optimal points exceeds this, in pixels
// of the photo. Features are accurate to half a pixel, and five models adjusted by COLMAP have
// 0.12 to 0.79.
inline constexpr double kPoseMisfit = 1.0;
// A refinement is accepted if it reduces the median error of held-out observations by at least
// this fraction.
inline constexpr double kRefinementPays = 0.1;

struct RefinePosesOptions {
  bool asked_for = false;          // refine below `misfit_px`, too, and accept any gain
  double misfit_px = kPoseMisfit;  // the threshold of the median error
  bool free_focal = false;         // adjust a factor of the focal lengths of each camera
};

struct PoseRefinement {
  int64_t observations = 0, held_out = 0;
  // Median at the given poses and adjusted points; points are not adjusted if it is low
  // already.
  double misfit_px = 0;
  bool tried = false;
  double refined_px = 0;                                 // median, poses and points adjusted
  double held_out_before_px = 0, held_out_after_px = 0;  // medians
  double turned_deg = 0, moved_fraction = 0;             // medians of the corrections ...
  std::optional<double> turn_error_deg, moved_error;     // ... and their standard errors
  int left_alone = 0;   // photos with too few observations to adjust
  std::string refused;  // why the result was rejected
  ColmapModel model;    // the given model unless `Accepted()`

  bool Accepted() const { return tried && refused.empty(); }
};

// EQ(pose-refinement): min over rotations w_v, centres c_v and points x_p of
//     sum over observations (v, p) of rho(|pi_v(exp(w_v) R_v (x_p - c_v)) - k_vp|^2),
// rho(s) = 2 a^2 (sqrt(1 + s / a^2) - 1), a twice the median error; pi_v is the camera's own
// projection through its lens. Gauge: the photo with the most observations keeps its pose, and
// the one farthest from it keeps a coordinate of its centre, so that standard errors (relative
// to the first) exist; then the world is aligned with the given poses (chordal mean of the
// rotations, least squares of the centres). Fractions are of the largest distance between two
// cameras.
//
// Independent of the order of photos. Throws Interrupted; reports numerical failures in
// `refused`.
PoseRefinement RefinePoses(const ColmapModel& model, const RefinePosesOptions& options,
                           const ProgressFunction& progress = {});

}  // namespace regrade
