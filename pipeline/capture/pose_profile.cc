#include "pipeline/capture/pose_profile.h"

#include <cstdarg>
#include <cstdio>

#include "kernels/base/error.h"
#include "pipeline/capture/scene_profile.h"
#include "reconstruct/refinement/refine_poses.h"

namespace regrade {
namespace {

__attribute__((format(printf, 1, 2))) std::string Text(const char* format, ...) {
  char text[256];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

std::string Evidence(const PoseRefinement& refinement) {
  std::string text =
      "median distance of observations from their points, wherever these are put, in pixels";
  if (!refinement.tried) return text;
  if (refinement.held_out_after_px > 0)
    text += Text(
        "; poses adjusted: %.2f, and %.2f instead of %.2f for %lld observations without "
        "a say",
        refinement.refined_px, refinement.held_out_after_px, refinement.held_out_before_px,
        static_cast<long long>(refinement.held_out));
  if (!refinement.Accepted()) return text + "; refused: " + refinement.refused;
  text += Text("; they turned by %.2g deg and moved by %.2g %% of the cameras' spread",
               refinement.turned_deg, 100 * refinement.moved_fraction);
  if (refinement.turn_error_deg)
    text += Text(", known to %.2g deg and %.2g %%", *refinement.turn_error_deg,
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
  const auto wishes = ParseEffects(effects);
  const auto wish = wishes.find(kPoseRefinement);
  const bool asked_for = wish != wishes.end() && wish->second;
  const double threshold = kPoseMisfit * misfit_scale;
  const auto leave_out = [asked_for, threshold](const char* why) -> PoseProfile {
    if (asked_for)
      throw Error(ExitCode::kScene, why, std::string("--effects ") + kPoseRefinement + "=on");
    return {{kPoseRefinement, false, why, Metric(), threshold}, JsonValue()};
  };
  if (wish != wishes.end() && !asked_for) return leave_out("it was not wanted");
  if (capture->points.empty())
    return leave_out("the poses came without tracks to hold them to");
  if (kind == CaptureKind::kPhotos && !asked_for)
    return leave_out("COLMAP has just adjusted them to their tracks");

  const PoseRefinement refinement = RefinePoses(
      ReadColmapModel(sparse_folder),
      {.asked_for = asked_for, .misfit_px = threshold, .free_focal = options.free_focal},
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
