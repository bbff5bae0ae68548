// Exposure and white balance of each photo, from the colours that its tracked points have in
// other photos.
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
  Vec3d light;  // linear, each channel > 0, not clipped
};

// Undoing exposures is worth its while from here on. 2 % of light is one step of an 8-bit
// picture's mid-tones: less, the field does not see.
inline constexpr double kExposureSpread = 0.02;
// ... and where noise does not explain the spread. Neighbouring points err alike: on a
// synthetic capture with poses from photos, gains were off by 3.6 of their standard errors
// (root mean square).
inline constexpr double kExposureErrors = 4;

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
  double spread = 0;        // root mean square of the log gains that are known, over channels
  double median_error = 0;  // of their standard errors

  // What `spread` is held against.
  double Threshold() const;
};

// EQ(exposure): min over log gains a_v and log colours b_p of
//     sum over observations (v, p) of rho(|log c_vp - a_v - b_p|^2),   sum_v a_v = 0 for each
//     channel,
// rho(s) = 2 k^2 (sqrt(1 + s / k^2) - 1), the norm over the channels: what hides a point or
// shines on it does so in all of them. It is strictly convex in the residuals, so there is one
// answer, whatever the order of photos. Photos that no track ties to the others have a sum of
// their own.
//
// Standard errors are those of the normal equations, which are linear here but for rho: the
// points' colours eliminated exactly, weights rho' at the minimum, the variance from the median
// absolute residual.
ExposureEstimate EstimateExposure(int num_views,
                                  const std::vector<ColorObservation>& observations);

}  // namespace regrade
