// Fits a radiance field to posed photos, coarse to fine: RMSProp on touched voxels, total
// variation and pruning by rendering weight as Plenoxels (Fridovich-Keil et al., CVPR 2022).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/device/backend.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/radiance_field.h"
#include "reconstruct/fit/fit_options.h"
#include "reconstruct/fit/training_rays.h"
#include "reconstruct/scene/scene_box.h"

namespace regrade {

struct FitCurvePoint {
  int64_t rays = 0;
  double seconds = 0;
  double psnr_train_db = 0;  // over the rays since the last point
  int64_t step = 0;          // steps done
};

// Running sums of a fit: window_* since the last point of the curve, tail_* over the last tenth
// of all steps.
struct FitTally {
  double window_error = 0, tail_error = 0;  // squared, over channels
  int64_t window_rays = 0, tail_rays = 0;
  int64_t rays = 0, samples = 0, rejected_voxels = 0;
  std::vector<FitCurvePoint> curve;
};

// Everything needed to resume a fit with the same result as without a stop (H110).
struct FitState {
  FastGrid grid;
  Buffer<float> second_moment;  // [N, lanes]
  int stage = 0;
  int step = 0;                 // within the stage
  Buffer<float> sphere_moment;  // [columns, L, 4]; empty without background spheres
  FitTally tally;
};

struct FitResult {
  RadianceField field;
  double psnr_train_db = 0;  // over the last tenth of the rays
  int64_t voxels = 0;
  int64_t rays = 0;
  int64_t samples = 0;
  int64_t rejected_voxels = 0;  // voxel updates skipped for a non-finite gradient
  double seconds = 0;           // of this call, without checkpoints
  std::vector<FitCurvePoint> curve;
};

class FitEngine;

struct FitHooks {
  ProgressFunction progress;
  FitState* resume = nullptr;  // moved from
  // Called at stage ends, about once a minute, and before an abort.
  std::function<void(const FitState&)> checkpoint;
};

// EQ(exponential-rate): rate(p) = begin^(1 - p) end^p, p the fraction of all steps done, or of
// fit-rate-steps; from p = 1 on it stays at `end`.
float ExponentialRate(float begin, float end, double p);
// Rises along a sine from 1/100 at step 0 to 1 at step `delay`.
float DelayFactor(int step, float delay);

// Throws Error(kScene) if no place of the box is seen by two photos or the field becomes empty,
// Interrupted after kStop (after calling `checkpoint`).
FitResult FitField(const std::vector<TrainingView>& views, const SceneBox& box,
                   const FitOptions& options, const FitHooks& hooks,
                   Backend backend = Backend::kCpu);

}  // namespace regrade
