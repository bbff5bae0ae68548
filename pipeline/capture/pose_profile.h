// Whether the poses of a capture are refined by its tracks, with the evidence.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/files/json_file.h"
#include "pipeline/workspace/metric.h"
#include "reconstruct/colmap/poses_from_photos.h"

namespace regrade {

struct PoseProfile {
  EffectReport effect;  // "pose-refinement"
  JsonValue metrics;    // of the trial; null where there was none
};

// Poses that came with tracks are refined where reprojection says so (refine_poses.h); those
// that COLMAP has just found and adjusted only if asked for. Where it pays, the model in
// `sparse_folder` and `capture` are rewritten; otherwise nothing is touched. `misfit_scale`:
// pixels of the photos that are one of those that features were found in. Throws
// Error(kScene) where refinement was asked for and there is nothing to refine by, Interrupted.
PoseProfile ProfilePoses(CaptureKind kind, const PoseOptions& options,
                         const std::string& effects, const std::string& sparse_folder,
                         const std::vector<StagedPhoto>& photos, double misfit_scale,
                         Capture* capture, const ProgressFunction& progress);

}  // namespace regrade
