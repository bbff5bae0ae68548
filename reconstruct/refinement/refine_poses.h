// Poses that came with a capture, adjusted to its tracks where these say that they are off, and
// whether that helped on observations which had no say.
//
// COLMAP's mapper adjusts what it has found itself. Poses from elsewhere may be rounded, of an
// earlier state of the model, or measured by something that is no camera.
#pragma once

#include <optional>
#include <string>

#include "kernels/base/progress.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// Poses are in question where a point's observations miss it by more than this, in pixels of
// the photo, in the median and wherever the point is put: features are found to half a pixel,
// and five models that COLMAP had adjusted have 0.12 to 0.79.
inline constexpr double kPoseMisfit = 1.0;
// A refinement is taken if it takes away this share at least of the median error of
// observations that it did not see.
inline constexpr double kRefinementPays = 0.1;

struct RefinePosesOptions {
  bool asked_for = false;          // try below `misfit_px`, too, and take any gain
  double misfit_px = kPoseMisfit;  // what poses are in question above
  bool free_focal = false;  // one factor of the focal lengths for each camera of the model
};

struct PoseRefinement {
  int64_t observations = 0, held_out = 0;
  // Median, points adjusted to the poses as they came; not adjusted where it is low already.
  double misfit_px = 0;
  bool tried = false;
  double refined_px = 0;                                    // median, poses and points adjusted
  double held_out_before_px = 0, held_out_after_px = 0;     // medians
  double turned_deg = 0, moved_share = 0;                   // medians of the corrections ...
  std::optional<double> turn_error_deg, place_error_share;  // ... and of their standard errors
  int left_alone = 0;   // photos with too few observations, their poses as they came
  std::string refused;  // why a trial was not taken
  ColmapModel model;    // as given, unless `Accepted()`

  bool Accepted() const { return tried && refused.empty(); }
};

// EQ(pose-refinement): min over rotations w_v, centres c_v and points x_p of
//     sum over observations (v, p) of rho(|pi_v(exp(w_v) R_v (x_p - c_v)) - k_vp|^2),
// rho(s) = 2 a^2 (sqrt(1 + s / a^2) - 1), a twice the median error; pi_v is the camera's own
// projection through its lens. The gauge: the photo with the most observations keeps its pose,
// and the one farthest from it a coordinate of its centre, so that standard errors exist, which
// are relative to the first; then the world is moved back to where the poses were on average
// (chordal mean of the rotations, least squares of the centres). Shares are of the largest
// distance between two cameras.
//
// Free of the order of photos. Throws Interrupted; numerical failures are a refusal.
PoseRefinement RefinePoses(const ColmapModel& model, const RefinePosesOptions& options,
                           const ProgressFunction& progress = {});

}  // namespace regrade
