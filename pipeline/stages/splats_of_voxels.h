// Splats in place of a field of voxels, fitted to its exact renders.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/device/backend.h"
#include "kernels/splats/splats.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/nearby_views.h"
#include "pipeline/run/run_settings.h"
#include "reconstruct/scene/normalize_scene.h"
#include "reconstruct/splats/splat_fit_options.h"

namespace regrade {

struct SplatsOfVoxelsOptions {
  float thousands = 500;  // of splats, at most
  int renders = 96;       // that are fitted, of the photos' working size, at most 640 pixels
  int steps = 800, color_steps = 300;
};

class SplatsOfVoxels {
 public:
  // `capture` and `settings` are those of the run that fitted the voxels.
  SplatsOfVoxels(const Capture& capture, const RunSettings& settings,
                 const SplatsOfVoxelsOptions& options, Backend backend);

  // Begins on the surfaces that the renders show. Throws Error(kScene) where they show none,
  // Interrupted.
  StoredField Fit(const StoredField& voxels, const ProgressFunction& progress);

  // The splats of Fit, in the colours of `voxels`, a style of the field that Fit was given.
  StoredField Recolor(const StoredField& voxels, const ProgressFunction& progress) const;

  // Views that take no part in the fits, in the frame of `stored`.
  std::vector<Camera> MeasuredViews(const StoredField& stored) const;

 private:
  // Continues with `splats` where it has some, and leaves the result in it.
  StoredField FitTo(const StoredField& voxels, const SplatFitOptions& fit, Splats* splats,
                    const ProgressFunction& progress) const;

  SplatsOfVoxelsOptions options_;
  SplatFitOptions fit_;  // of the scene
  Backend backend_;
  NearbyViews views_;      // in the capture's world
  NormalizedScene scene_;  // of the splats
  Splats splats_;          // of the scene
};

}  // namespace regrade
