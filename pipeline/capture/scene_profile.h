// What the scene calls for, decided from what was measured of its capture, and the space that
// follows from it.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/capture/photo_gains.h"
#include "pipeline/files/json_file.h"
#include "pipeline/workspace/metric.h"
#include "reconstruct/scene/normalize_scene.h"

namespace regrade {

// What the user decided instead: "auto", or "ndc=off,alpha=on" and the like. Throws
// Error(kUsage) naming the word for anything else.
std::map<std::string, bool> ParseEffects(const std::string& text);

// The row that a fit's trial decides (choose_degree.h).
inline constexpr char kViewDependence[] = "view-dependence";
// The row that stage "pose" decides (pose_profile.h).
inline constexpr char kPoseRefinement[] = "pose-refinement";

struct SceneProfile {
  // One row an effect. "distortion": the lens is followed where it moves a picture's corner by
  // more than kDistortionThreshold (working_views.h). "ndc": all cameras look one way
  // (forward_facing.h). "alpha": all photos have transparent parts; white is behind them and
  // the box is the object's. "background": much is far beyond what the cameras stand round
  // (normalize_scene.h); it is on spheres behind a box round the latter. "view-dependence":
  // colours change with the direction, as `sh_degree` was set; the fit's trial has the last
  // word. "exposure": photos differ in brightness or white balance by more than noise explains,
  // and undoing that pays on points that had no say in it (exposure.h).
  std::vector<EffectReport> effects;
  NormalizedScene scene;
  ExposureEstimate exposure;         // empty where it was not measured
  PhotoGains gains;                  // to be undone; none where exposure is off
  std::vector<std::string> notices;  // sentences for a person
};

// Has every photo transparent parts, and more of them than a soft edge has?
bool ShowsThroughPhotos(const Capture& capture);

// Free of the photos' order (H154). Reads every photo, unless "exposure=off". Throws
// Error(kScene) where an effect was asked for that the capture does not allow.
SceneProfile ProfileScene(const Capture& capture, int sh_degree, const std::string& effects);

// "distortion on: 12.3 > 0.5 (pixels, ...)"
std::string EffectLine(const EffectReport& effect);

// For the record of a stage, and back.
JsonValue EffectsRecord(const std::vector<EffectReport>& effects);
std::vector<EffectReport> EffectsOfRecord(const JsonValue& record);

}  // namespace regrade
