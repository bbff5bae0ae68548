// Whether a scene's colours change enough with the direction to be worth the memory: a trial
// that fits it small, with and without.
#pragma once

#include "reconstruct/fit/fit_field.h"

namespace regrade {

// View dependence pays if it gains this much on views that were kept from the trial. Less is
// below what the choice of a seed does.
inline constexpr double kDegreePays = 0.1;  // dB

// A assessment, from one capture: of nine flash photos the trial kept two, and these spoke
// against a view dependence that the other seven showed. How many views make it sure is not
// measured.
inline constexpr int kLeastTrialViews = 10;

struct DegreeTrial {
  double gain_db = 0;  // of `options.sh_degree` over degree 0, on every fifth view
  bool Pays() const { return gain_db > kDegreePays; }
};

// Fits with the voxels as large in pixels as they will be, for a wrong place that a few pixels
// of a voxel leave to colours is what view dependence serves, too, even where all surfaces are
// matte. Free of the number of threads where options.shards is set. Throws as FitField does.
// With fewer than kLeastTrialViews nothing is tried, and it pays.
DegreeTrial TryDegrees(const std::vector<TrainingView>& views, const SceneBox& box,
                       const FitOptions& options, const ProgressFunction& progress,
                       Backend backend);

}  // namespace regrade
