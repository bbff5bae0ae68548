// Decides by a small trial fit whether view-dependent colour is worth its memory.
#pragma once

#include "reconstruct/fit/fit_field.h"

namespace regrade {

// View dependence pays if it gains this much on held-out views. Another seed changes the result
// by as much as a smaller gain.
inline constexpr double kDegreePays = 0.1;  // dB

// Chosen from one capture: of nine flash photos the trial held out two, and these rejected a
// view dependence that the other seven showed. The number of views for a reliable decision has
// not been measured.
inline constexpr int kLeastTrialViews = 10;

struct DegreeTrial {
  double gain_db = 0;  // of `options.sh_degree` over degree 0, on every fifth view (held out)
  bool Pays() const { return gain_db > kDegreePays; }
};

// Fits degree 0 and `options.sh_degree` to photos scaled so that a voxel covers as many pixels
// as in the full fit: view dependence also compensates for surfaces misplaced within a voxel,
// even in matte scenes. Independent of the number of threads if options.shards is set. Throws
// as FitField does. With fewer than kLeastTrialViews views there is no trial, and gain_db is
// infinite.
DegreeTrial TryDegrees(const std::vector<TrainingView>& views, const SceneBox& box,
                       const FitOptions& options, const ProgressFunction& progress,
                       Backend backend);

}  // namespace regrade
