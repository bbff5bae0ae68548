#include "pipeline/capture/pose_profile.h"

#include "kernels/base/error.h"
#include "pipeline/capture/scene_profile.h"
#include "reconstruct/refinement/refine_poses.h"

namespace regrade {
namespace {

std::string Evidence(const PoseRefinement& refinement) {
  std::string text = "median reprojection error after optimal triangulation, in pixels";
  if (!refinement.tried) return text;
  if (refinement.held_out_after_px > 0)
    text += Format(
        "; after bundle adjustment: %.2f, and %.2f instead of %.2f for %lld held-out "
        "observations",
        refinement.refined_px, refinement.held_out_after_px, refinement.held_out_before_px,
        static_cast<long long>(refinement.held_out));
  if (!refinement.Accepted()) return text + "; refused: " + refinement.refused;
  text += Format("; cameras turned by %.2g deg and moved by %.2g %% of their extent",
                 refinement.turned_deg, 100 * refinement.moved_fraction);
  if (refinement.turn_error_deg)
    text += Format(", standard errors %.2g deg and %.2g %%", *refinement.turn_error_deg,
                   100 * *refinement.moved_error);
  return text;
}

JsonValue NumberOrNull(const std::optional<double>& number) {
  return number ? JsonValue(*number) : JsonValue();
}

JsonValue MetricsOf(const PoseRefinement& refinement) {
  return JsonValue::Object{{"observations", refinement.observations},
                           {"held_out", refinement.held_out},
                           {"misfit_px", refinement.misfit_px},
                           {"refined_px", refinement.refined_px},
                           {"held_out_before_px", refinement.held_out_before_px},
                           {"held_out_after_px", refinement.held_out_after_px},
                           {"turned_deg", refinement.turned_deg},
                           {"moved_fraction", refinement.moved_fraction},
                           {"turn_error_deg", NumberOrNull(refinement.turn_error_deg)},
                           {"moved_error", NumberOrNull(refinement.moved_error)},
                           {"left_alone", refinement.left_alone},
                           {"refused", refinement.refused}};
}

}  // namespace

PoseProfile ProfilePoses(CaptureKind kind, const PoseOptions& options,
                         const std::string& effects, const std::string& sparse_folder,
                         const std::vector<StagedPhoto>& photos, double misfit_scale,
                         Capture* capture, const ProgressFunction& progress) {
  const auto overrides = ParseEffects(effects);
  const auto override = overrides.find(kPoseRefinement);
  const bool requested = override != overrides.end() && override->second;
  const double threshold = kPoseMisfit * misfit_scale;
  const auto leave_out = [requested, threshold](const char* why) -> PoseProfile {
    if (requested) throw SceneError(why, std::string("--effects ") + kPoseRefinement + "=on");
    return {{kPoseRefinement, false, why, Metric(), threshold}, JsonValue()};
  };
  if (override != overrides.end() && !requested) return leave_out("off by --effects");
  if (capture->points.empty()) return leave_out("the poses are without tracks");
  if (kind == CaptureKind::kPhotos && !requested)
    return leave_out("COLMAP has just adjusted them");

  const PoseRefinement refinement = RefinePoses(
      ReadColmapModel(sparse_folder),
      {.asked_for = requested, .misfit_px = threshold, .free_focal = options.free_focal},
      progress);
  if (refinement.Accepted()) {
    WriteColmapModel(refinement.model, sparse_folder);
    Capture refined = CaptureFromModel(refinement.model, photos, PhotoNames::kStaged);
    capture->views = std::move(refined.views);
    capture->points = std::move(refined.points);
    capture->reprojection_px = refined.reprojection_px;
  }
  return {{kPoseRefinement, refinement.Accepted(), Evidence(refinement), refinement.misfit_px,
           threshold},
          refinement.tried ? MetricsOf(refinement) : JsonValue()};
}

}  // namespace regrade
