// Exposure and white balance of each photo, from the colours that its tracked points have in
// other photos, and whether undoing them pays.
//
// A phone chooses both anew for every picture; a radiance field has one colour a place and
// direction, and would spend its density on the difference.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/vec.h"

namespace regrade {

// A scene point's colour in one photo.
struct ColorObservation {
  int32_t view = 0;
  int32_t point = 0;
  Vec3d light;       // linear, each channel > 0, not clipped
  int32_t fold = 0;  // of its point, in [0, kExposureFolds): points of a fold err together
};

// So many parts of the scene are left out in turn (exposure_folds.h).
inline constexpr int kExposureFolds = 16;

// Gains pay if, found from the other parts of the scene, they take this share at least of the
// disagreement between photos about the colours of the part that was left out. What shines or
// lies in shade there does not follow gains from elsewhere; noise follows none.
inline constexpr double kExposurePays = 0.1;
// ... and if the share is this many standard errors above nothing,
inline constexpr double kExposureSurety = 3;
// ... and gains spread by more than this: 2 % of light is one step of an 8-bit picture's
// mid-tones. Less, the field does not see.
inline constexpr double kExposureSpread = 0.02;

// A photo with fewer is not judged: one surface that shines could decide.
inline constexpr int kFewestColors = 20;

struct PhotoExposure {
  Vec3d gain{1, 1, 1};   // its linear light is this times that of the capture's mean photo
  Vec3d log_error;       // standard error of the logarithm of `gain`
  int observations = 0;  // that were of use: of points that another photo sees, too
  bool known = false;    // false: too few, and `gain` is 1
};

struct ExposureEstimate {
  std::vector<PhotoExposure> photos;
  double spread = 0;           // root mean square of the known log gains, over channels
  double median_error = 0;     // of their standard errors
  double explained = 0;        // share of the disagreement about points that were left out
  double explained_error = 0;  // its standard error

  // What `explained` is held against.
  double Threshold() const;
  bool Pays() const { return spread > kExposureSpread && explained > Threshold(); }
};

// EQ(exposure): min over log gains a_v and log colours b_p of
//     sum over observations (v, p) of rho(|log c_vp - a_v - b_p|^2),   sum_v a_v = 0 for each
//     channel,
// rho(s) = 2 k^2 (sqrt(1 + s / k^2) - 1), the norm over the channels: what hides a point or
// shines on it does so in all of them. It is strictly convex in the residuals, so there is one
// answer, whatever the order of photos. Photos that no track ties to the others have a sum of
// their own.
//
// EQ(exposure-pays): explained = 1 - D(a^(-f)) / D(0), D(a) = sum over folds f of the least
// sum of rho that colours b alone reach on the points of f at gains a; a^(-f) is the minimum
// over the other folds. Standard errors are jackknifed over folds (Miller 1974):
// (F - 1) / F sum_f (x^(-f) - mean)^2, x a log gain, or the explained share of the other folds.
// Neighbouring points err alike, and so count as one.
ExposureEstimate EstimateExposure(int num_views,
                                  const std::vector<ColorObservation>& observations);

}  // namespace regrade
