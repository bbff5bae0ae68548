// Stage "reconstruct": the capture becomes field.npz, measured on the photos it has not seen.
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "kernels/device/device_memory.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/scene_profile.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/fit_checkpoint.h"
#include "pipeline/program/cpu_time.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/program/memory.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/run/plan.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/held_out.h"
#include "pipeline/stages/stages.h"
#include "pipeline/workspace/metrics_json.h"
#include "reconstruct/fit/choose_degree.h"
#include "reconstruct/fit/fit_field.h"

namespace regrade {
namespace {

constexpr double kAfterFit =
    0.08;  // pruning, writing and measuring, as a share of the steps' time
constexpr double kTrial = 0.08;         // the trial of degrees, likewise
constexpr int kReproducibleShards = 4;  // sums in a fixed grouping, whatever the threads

// To a thousandth: what a drawing can show.
double Rounded(double value) { return std::round(value * 1000) / 1000; }

void SetHeldOut(const HeldOutMetrics& held_out, ReconstructReport* metrics) {
  const char* why = held_out.files.empty() ? "no photo was held out" : "";
  metrics->heldout = held_out.files;
  metrics->psnr_heldout_db = Metric(held_out.MeanPsnr(), why);
  metrics->ssim_heldout = Metric(held_out.MeanSsim(), why);
}

int Finest(const FitOptions& options) {
  return *std::max_element(options.resolutions.begin(), options.resolutions.end());
}

// What a fit of this capture's photos takes, by its options.
std::function<StagePlan(const FitOptions&)> PlannerOf(const RunSettings& settings,
                                                      const Capture& capture,
                                                      const SceneBox& box, Backend backend) {
  int64_t pixels = 0;
  for (const int i : ViewIndices(capture, settings.run.holdout, false)) {
    const Camera camera = WorkingCamera(capture.views[static_cast<size_t>(i)].camera,
                                        settings.scene.photo_size, {}, {});
    pixels += int64_t{camera.width} * camera.height;
  }
  return [pixels, box, backend](const FitOptions& options) {
    return backend == Backend::kCuda ? PlanFitOnDevice(options, pixels, box)
                                     : PlanFit(options, pixels, box, omp_get_max_threads());
  };
}

// The fit's options, their resolutions lowered where memory asks for it: said, and recorded.
FitOptions OptionsForMemory(RunContext* context,
                            const std::function<StagePlan(const FitOptions&)>& plan_of,
                            Backend backend) {
  const RunSettings& settings = context->settings;
  const bool on_device = backend == Backend::kCuda;
  const uint64_t limit =
      PlannedMemory(settings.run.max_memory_gb,
                    on_device ? static_cast<uint64_t>(ReadDeviceStatus().free_bytes)
                              : ReadMemoryStatus().available);
  FitOptions options = settings.fit;
  options.seed = settings.run.seed;
  // What happens to be free must not decide about the bytes of a reproducible run.
  if ((!settings.run.reproducible || settings.run.max_memory_gb > 0) &&
      LowerToMemory(plan_of, limit, &options))
    context->console->Info(
        "the finest grid has " + std::to_string(Finest(options)) +
        " voxels a side instead of " + std::to_string(Finest(settings.fit)) +
        ": more would not fit into " +
        (settings.run.max_memory_gb > 0 ? "--max-memory" : "the memory that is free"));
  const StagePlan plan = plan_of(options);
  context->console->Info("the fit will take " + PlanText(plan));
  CheckFitsMemory(plan, limit, on_device ? "GPU memory" : "memory");
  return options;
}

// Whether the fit keeps its spherical harmonics, and the row that says why.
EffectReport ProfileViewDependence(const RunSettings& settings, const FitOptions& options,
                                   const std::vector<TrainingView>& views, const SceneBox& box,
                                   const ProgressFunction& progress, Backend backend) {
  const auto row = [](bool on, const Metric& value, const std::string& evidence) {
    return EffectReport{kViewDependence, on, evidence, value, kDegreePays};
  };
  const auto wishes = ParseEffects(settings.run.effects);
  const auto wish = wishes.find(kViewDependence);
  const bool wanted = wish == wishes.end() || wish->second;
  if (options.sh_degree == 0 || !wanted) return row(false, Metric(), "as asked for");
  if (wish != wishes.end()) return row(true, Metric(), "as asked for");
  if (views.size() < kLeastTrialViews)
    return row(true, Metric(), "too few photos to keep some from a trial");
  const DegreeTrial trial = TryDegrees(views, box, options, progress, backend);
  if (!std::isfinite(trial.gain_db))
    return row(true, Metric(),
               "too little of the photos is not masked to keep some from a trial");
  return row(trial.Pays(), trial.gain_db,
             "decibels that harmonics of degree " + std::to_string(options.sh_degree) +
                 " gain over one colour for all directions, on a fifth of the views that a "
                 "small trial did not see");
}

StageOutcome Reconstruct(RunContext* context, const JsonValue& inputs,
                         const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->workspace;
  const Capture capture = ReadCapture(workspace.Path("poses"));
  SceneProfile profile = ProfileScene(capture, settings.fit.sh_degree, settings.run.effects);
  const NormalizedScene& scene = profile.scene;
  if (!scene.notice.empty()) context->console->Info(scene.notice);
  for (const EffectReport& effect : profile.effects)
    if (effect.name != kViewDependence) context->console->Info(EffectLine(effect));
  for (const std::string& notice : profile.notices) context->console->Info(notice);
  const Backend backend = ChooseBackend(settings.run.device, settings.run.reproducible);
  FitOptions options =
      OptionsForMemory(context, PlannerOf(settings, capture, scene.box, backend), backend);

  const std::vector<int> fitted = ViewIndices(capture, settings.run.holdout, false);
  std::vector<Image> photos;
  photos.reserve(fitted.size());
  std::vector<TrainingView> views;
  for (const int i : fitted) {
    const CaptureView& view = capture.views[static_cast<size_t>(i)];
    Image photo = ReadPhotoToFit(view, settings.scene.photo_size, profile.gains.Of(i));
    if (photo.empty()) {
      context->console->Info(view.file + ": its mask leaves nothing to fit");
      continue;
    }
    photos.push_back(std::move(photo));
    views.push_back({WorkingCamera(view.camera, settings.scene.photo_size,
                                   scene.field_from_world, scene.ndc),
                     &photos.back()});
  }

  if (settings.run.reproducible && options.shards == 0) options.shards = kReproducibleShards;
  FitHooks hooks;
  std::string measured;  // the row of view dependence: an interruption must not change it
  hooks.checkpoint = [&](const FitState& state) {
    workspace.SaveCheckpoint("reconstruct", inputs, PackFitState(state, measured));
  };
  std::optional<FitState> resume;
  if (const auto bytes = workspace.LoadCheckpoint("reconstruct", inputs))
    resume = UnpackFitState(*bytes, &measured);
  if (resume) {
    hooks.resume = &*resume;
    context->console->Info("reconstruct: goes on from its checkpoint");
  }
  if (views.empty())
    throw Error(ExitCode::kInput, "leave nothing to fit of any photo",
                settings.pose.photo_masks.empty() ? "the masks" : settings.pose.photo_masks,
                "make the masks' white parts larger");
  ProgressParts parts(progress, kTrial + 1 + kAfterFit);
  EffectReport& view_dependence =
      *std::find_if(profile.effects.begin(), profile.effects.end(),
                    [](const EffectReport& effect) { return effect.name == kViewDependence; });
  const ProgressFunction trial = parts.Next(kTrial);
  const double trial_begin = context->console->StageSeconds(), trial_cpu_begin = CpuSeconds();
  view_dependence =
      resume ? EffectsOfRecord(ParseJson(measured, "checkpoint")).at(0)
             : ProfileViewDependence(settings, options, views, scene.box, trial, backend);
  measured = DumpJson(EffectsRecord({view_dependence}), -1);
  const double trial_seconds = context->console->StageSeconds() - trial_begin,
               trial_cpu_seconds = CpuSeconds() - trial_cpu_begin;
  context->console->Info(EffectLine(view_dependence));
  if (!view_dependence.on) options.sh_degree = 0;
  hooks.progress = parts.Next(1);
  const FitResult fit = FitField(views, scene.box, options, hooks, backend);

  WriteFieldFile(workspace.Path("field.npz"), {fit.field, scene.field_from_world, scene.ndc});
  StageOutcome outcome;
  outcome.outputs = {"field.npz"};
  outcome.metrics["effects"] = EffectsRecord(profile.effects);
  if (!profile.gains.of_view.empty())
    outcome.metrics["exposure"] = GainsRecord(capture, profile.exposure, profile.gains);
  ReconstructReport metrics;
  if (!resume && view_dependence.value.value) {  // a prediction needs them apart
    metrics.trial_seconds = trial_seconds;
    metrics.trial_cpu_seconds = trial_cpu_seconds;
  }
  metrics.device = DeviceName(backend);
  metrics.finest_grid = Finest(options);
  metrics.rays = fit.rays;
  metrics.sh_degree = options.sh_degree;
  metrics.voxels = fit.field.geometry->num_voxels();
  if (scene.box.spheres) metrics.background_texels = fit.field.geometry->spheres.num_texels();
  metrics.psnr_train_db = fit.psnr_train_db;
  metrics.rejected_voxels = fit.rejected_voxels;
  for (const FitCurvePoint& point : fit.curve)
    if (std::isfinite(point.psnr_train_db))
      metrics.psnr_at_steps.emplace_back(point.step, Rounded(point.psnr_train_db));
  SetHeldOut(MeasureHeldOut(capture, settings.run.holdout, settings.scene.photo_size,
                            profile.gains, ReadFieldFile(workspace.Path("field.npz")), backend),
             &metrics);
  PutMetrics(metrics, &outcome.metrics);
  return outcome;
}

}  // namespace

Stage ReconstructStage(RunContext* context) {
  const RunOptions& run = context->settings.run;
  Stage stage;
  stage.name = "reconstruct";
  stage.inputs = JsonValue::Object{
      {"poses", context->ResultOf("pose")},
      {"options", OptionValues(context->settings.scene, context->settings.fit)},
      {"seed", run.seed},
      {"holdout", run.holdout},
      {"effects", run.effects},
      {"reproducible", run.reproducible}};
  stage.refuse_changes = true;
  if (context->settings.start.dry_run) {
    const Capture capture = ReadCapture(context->workspace->Path("poses"));
    // Exposures have no say in the box, and measuring them would read every photo.
    const SceneProfile profile =
        ProfileScene(capture, context->settings.fit.sh_degree, run.effects + ",exposure=off");
    const SceneBox& box = profile.scene.box;
    const Backend backend = ChooseBackend(run.device, run.reproducible);
    stage.plan =
        PlanText(PlannerOf(context->settings, capture, box, backend)(context->settings.fit));
  }
  stage.work = [context, inputs = stage.inputs](const ProgressFunction& progress) {
    return Reconstruct(context, inputs, progress);
  };
  return stage;
}

}  // namespace regrade
