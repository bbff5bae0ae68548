// Decides from measurements of a capture which effects to model, and the field's frame and box.
#pragma once

#include <string>
#include <vector>

#include "kernels/field/field_kind.h"
#include "kernels/scene/capture.h"
#include "pipeline/capture/effect_words.h"
#include "pipeline/capture/photo_gains.h"
#include "pipeline/files/json_file.h"
#include "pipeline/workspace/metric.h"
#include "reconstruct/scene/box_options.h"
#include "reconstruct/scene/normalize_scene.h"

namespace regrade {

struct SceneProfile {
  // One row per effect:
  // "distortion": the lens moves a picture's corner by more than kDistortionThreshold
  //   (working_views.h), and is modelled.
  // "ndc": forward-facing cameras (forward_facing.h).
  // "alpha": all photos have transparent parts; the background is white, the box the object's.
  // "background": much of the scene is far beyond what the cameras surround
  //   (normalize_scene.h); it is modelled on spheres outside the box, or by far splats.
  // "view-dependence": colours change with direction, up to `sh_degree`; the fit's trial
  //   decides.
  // "exposure": photos differ in brightness or white balance by more than noise explains, and
  //   undoing that improves held-out points (exposure.h).
  std::vector<EffectReport> effects;
  NormalizedScene scene;
  ExposureEstimate exposure;         // empty if not measured
  PhotoGains gains;                  // to be undone; none if exposure is off
  std::vector<std::string> notices;  // sentences for the user
};

// True if every photo has transparent parts, more than a soft edge has.
bool ShowsThroughPhotos(const Capture& capture);

// Independent of the photos' order (H154). Reads every photo, unless "exposure=off". Records
// that are on no lattice lie in the world as it is: they need no device coordinates, and their
// box holds far points, too. Throws Error(kScene) for a requested effect that the capture does
// not allow.
SceneProfile ProfileScene(const Capture& capture, int sh_degree, const std::string& effects,
                          const BoxOptions& box = {},
                          const FieldKind& field = KindNamed("voxels"));

// "distortion on: 12.3 > 0.5 (largest shift ...)"
std::string EffectLine(const EffectReport& effect);

// To and from the record of a stage.
JsonValue EffectsRecord(const std::vector<EffectReport>& effects);
std::vector<EffectReport> EffectsOfRecord(const JsonValue& record);

}  // namespace regrade
