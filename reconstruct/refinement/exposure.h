// Estimates exposure and white balance of each photo from the colours of tracked points in
// other photos, and decides whether correcting them pays.
//
// A phone chooses both anew for every photo. A radiance field has one colour per position and
// direction, and would model the difference by wrong density.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/vec.h"

namespace regrade {

// A scene point's colour in one photo.
struct ColorObservation {
  int32_t view = 0;
  int32_t point = 0;
  Vec3d light;         // linear, each channel > 0, not clipped
  int32_t fold = 0;    // of its point, in [0, kExposureFolds); see SpatialFolds
  double radius2 = 0;  // squared distance from the picture's middle over half its diagonal
};

// Number of parts of the scene that are left out in turn (exposure_folds.h).
inline constexpr int kExposureFolds = 16;

// Gains pay if, estimated from the other parts of the scene, they explain at least this
// fraction of the disagreement between photos about the colours of the part left out. Gains
// from elsewhere explain neither highlights and shadows there nor noise.
inline constexpr double kExposurePays = 0.1;
// ... and if that fraction is at least this many of its standard errors,
inline constexpr double kExposureSigmas = 3;
// ... and if the RMS of the log gains exceeds this: 2 % of light is one step of an 8-bit
// picture's mid-tones, and smaller differences do not affect the field.
inline constexpr double kExposureSpread = 0.02;

// A photo with fewer observations gets no gain: one shiny surface could determine it.
inline constexpr int kFewestColors = 20;

struct PhotoExposure {
  Vec3d gain{1, 1, 1};   // its linear light relative to that of the capture's mean photo
  Vec3d log_error;       // standard error of the logarithm of `gain`
  int observations = 0;  // used ones: of points that another photo sees, too
  bool known = false;    // false: too few observations, and `gain` is 1
};

struct ExposureEstimate {
  std::vector<PhotoExposure> photos;
  double spread = 0;           // root mean square of the known log gains, over channels
  double median_error = 0;     // median of their standard errors
  double explained = 0;        // fraction of the disagreement about points that were left out
  double explained_error = 0;  // its standard error

  // The least `explained` at which gains pay.
  double Threshold() const;
  bool Pays() const { return spread > kExposureSpread && explained > Threshold(); }
};

// EQ(exposure): min over log gains a_v and log colours b_p of
//     sum over observations (v, p) of rho(|log c_vp - a_v - b_p|^2),   sum_v a_v = 0 for each
//     channel,
// rho(s) = 2 k^2 (sqrt(1 + s / k^2) - 1), the norm over the channels, because occlusions and
// highlights affect all of them. It is strictly convex in the residuals, so the minimum is
// unique and independent of the order of photos. Each group of photos connected by tracks has a
// gauge sum_v a_v = 0.
//
// EQ(exposure-pays): explained = 1 - D(a^(-f)) / D(0), D(a) = sum over folds f of the least
// sum of rho over colours b on the points of f at fixed gains a; a^(-f) is the minimum over the
// other folds. Standard errors are jackknifed over folds (Miller 1974):
// (F - 1) / F sum_f (x^(-f) - mean)^2, x a log gain, or the explained fraction of the other
// folds: neighbouring points have correlated errors, so each fold counts as one sample.
ExposureEstimate EstimateExposure(int num_views,
                                  const std::vector<ColorObservation>& observations);

}  // namespace regrade
