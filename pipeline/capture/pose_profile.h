// Decides whether the poses of a capture are refined by its tracks, and does it.
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
  JsonValue metrics;    // of the trial; null without one
};

// Given poses with tracks are refined if reprojection errors ask for it (refine_poses.h); poses
// that COLMAP has just adjusted only if requested. If held-out observations improve, the model
// in `sparse_folder` and `capture` are rewritten; otherwise both stay unchanged.
// `misfit_scale`: see PoseTracks. Throws Error(kScene) if refinement was requested and there
// are no tracks, Interrupted.
PoseProfile ProfilePoses(CaptureKind kind, const PoseOptions& options,
                         const std::string& effects, const std::string& sparse_folder,
                         const std::vector<StagedPhoto>& photos, double misfit_scale,
                         Capture* capture, const ProgressFunction& progress);

}  // namespace regrade
