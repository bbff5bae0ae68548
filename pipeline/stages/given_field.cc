#include "pipeline/stages/given_field.h"

#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>

#include "kernels/splats/splat_field.h"
#include "pipeline/capture/photo_gains.h"
#include "pipeline/capture/scene_profile.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/placed_splats.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/stages/fit_quality.h"
#include "pipeline/stages/foreign_splats.h"
#include "pipeline/workspace/metrics_json.h"

namespace regrade {
namespace {

// The photos' exposures are left: the splats were fitted to them as they are. A render has no
// transparent parts, and its background is that of the file.
std::string EffectsOf(const RunSettings& settings, const Capture& capture) {
  return settings.run.effects + ",exposure=off" + (capture.rendered ? ",alpha=off" : "");
}

StageOutcome ReadGivenField(RunContext* context, const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->workspace;
  const WorkingViews as_taken = context->Views().AsTaken();
  const Capture& capture = as_taken.capture();
  SplatScene file = ReadForeignSplats(context->source, settings.run.max_memory_gb, nullptr);
  ReportOrThrow(progress, 1, 3);
  const int degree = DegreeOf(file.splats.basis);
  SceneProfile profile = ProfileScene(capture, degree, EffectsOf(settings, capture),
                                      settings.scene.box, settings.scene.Kind());
  const NormalizedScene& scene = profile.scene;
  if (!scene.notice.empty()) context->console->Info(scene.notice);
  for (EffectReport& effect : profile.effects) {
    if (effect.name == kViewDependence)
      effect.value = Metric(), effect.evidence = "as the file of splats has it";
    context->console->Detail(EffectLine(effect));
  }
  MoveSplats(scene.field_from_world, &file.splats);
  file.splats.background = scene.box.background.value_or(Vec3f{0, 0, 0});
  const Backend backend = ChooseBackend(settings.run.device, settings.run.reproducible);
  ReconstructReport metrics;
  metrics.device = DeviceName(backend);
  metrics.sh_degree = degree;
  metrics.splats = file.splats.count();
  metrics.psnr_train_db = Metric::Undefined("the splats were fitted by another program");
  {
    // Freed once it is written: what is measured is the file.
    const StoredField stored{
        FieldOfSplats(file.splats, {{}, scene.box.center, scene.box.radius},
                      scene.box.near_clip, file.antialiased ? 0.0f : -1.0f),
        scene.field_from_world,
        {}};
    file = {};
    WriteFieldFile(workspace.Path("field.npz"), stored);
  }
  ReportOrThrow(progress, 2, 3);
  // Of an earlier run.
  std::filesystem::remove(workspace.Path("poses") + "/" + kExposureFile);
  const StoredField stored = ReadFieldFile(workspace.Path("field.npz"));
  MeasureFit(as_taken.InField(stored), stored, backend, true, context->console, &metrics);
  StageOutcome outcome;
  outcome.outputs = {"field.npz"};
  outcome.metrics["effects"] = EffectsRecord(profile.effects);
  PutMetrics(metrics, &outcome.metrics);
  return outcome;
}

}  // namespace

Stage GivenFieldStage(RunContext* context) {
  const RunSettings& settings = context->settings;
  Stage stage;
  stage.name = "reconstruct";
  stage.title = "taking the splats as they are";
  stage.inputs = JsonValue::Object{{"poses", context->ResultOf("pose")},
                                   {"splats", HashFile(context->source)},
                                   {"options", OptionValues(settings.scene)},
                                   {"holdout", settings.run.holdout},
                                   {"effects", settings.run.effects}};
  stage.refuse_changes = true;
  stage.plan = "the splats of " + context->source;
  stage.work = [context](const ProgressFunction& progress) {
    return ReadGivenField(context, progress);
  };
  return stage;
}

}  // namespace regrade
