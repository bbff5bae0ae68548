// Fits splats to posed photos: Adam on whole photos, with a population that moves and grows, as
// Kheradmand et al. 2024 (3D Gaussian Splatting as Markov Chain Monte Carlo).
#pragma once

#include <functional>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/device/backend.h"
#include "kernels/splats/splat_update.h"
#include "kernels/splats/splats.h"
#include "reconstruct/fit/training_rays.h"
#include "reconstruct/scene/scene_box.h"
#include "reconstruct/splats/splat_fit_options.h"
#include "reconstruct/splats/splat_photos.h"

namespace regrade {

struct SplatCurvePoint {
  int64_t step = 0;  // done
  double seconds = 0;
  double psnr_train_db = 0;  // over the steps since the last point
  int64_t splats = 0;
};

// Running sums of a fit: window_* since the last point of the curve, tail_* over the last
// tenth.
struct SplatFitTally {
  double window_error = 0, tail_error = 0;
  int64_t window_values = 0, tail_values = 0;
  int64_t pixels = 0, entries = 0, rejected = 0;
  std::vector<SplatCurvePoint> curve;
};

// Everything needed to resume a fit with the same result as without a stop.
struct SplatFitState {
  Splats splats, first_moment, second_moment;
  int64_t frozen = 0;         // the first ones, which the fit does not change
  bool spare_unseen = false;  // see SplatUpdate; decided before the first step
  int step = 0;
  SplatFitTally tally;
};

struct SplatFitResult {
  Splats splats;
  double psnr_train_db = 0;
  int64_t pixels = 0;  // compared, over all steps
  int64_t rejected = 0;
  float fit_pixel = -1;         // see SplatOptions; below 0 if the photos' differ
  double entries_per_step = 0;  // splats in tiles, which work grows with
  double seconds = 0;           // of this call, without checkpoints
  std::vector<SplatCurvePoint> curve;
};

class SplatEngine;

struct SplatFitHooks {
  ProgressFunction progress;
  std::function<void(SplatEngine*)> measure;  // called at the end
  SplatFitState* resume = nullptr;            // moved from
  std::function<void(const SplatFitState&)> checkpoint;
};

// With fewer than 15000 steps, rates of means, scales and colours and the growth are larger by
// the ratio to the power 0.3, and the last rate of means by the ratio, up to 10.
// Throws Error(kScene) if no place of the box is seen by two photos, Interrupted after kStop
// (after calling `checkpoint`).
SplatFitResult FitSplats(const std::vector<TrainingView>& views, const SceneBox& box,
                         const SplatFitOptions& options, const SplatFitHooks& hooks,
                         Backend backend = Backend::kCpu);

// The state of a fit that goes on from splats, of which the first `frozen` stay as they are.
SplatFitState RefinementOf(Splats splats, int64_t frozen);

// Goes on from the state hooks.resume, with the photos at their size from the first step on;
// other splats than the frozen ones are held in `hold`. Limits of their number are without
// those. Otherwise as FitSplats.
SplatFitResult RefineSplats(const SplatPhotos& photos, const SplatHold& hold,
                            const SceneBox& box, const SplatFitOptions& options,
                            const SplatFitHooks& hooks, Backend backend = Backend::kCpu);

}  // namespace regrade
