// Stage "reconstruct": fits field.npz to the capture, and measures it on held-out photos.
#include <algorithm>
#include <cmath>
#include <string>

#include "kernels/base/error.h"
#include "kernels/base/parallel_tasks.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/guessed_depths.h"
#include "pipeline/capture/measured_depths.h"
#include "pipeline/capture/scene_profile.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/files/text.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/run/fit_kind.h"
#include "pipeline/run/paper_config.h"
#include "pipeline/run/profile_run.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/fit_quality.h"
#include "pipeline/stages/scene_source.h"
#include "pipeline/stages/stages.h"
#include "pipeline/workspace/folder_size.h"
#include "pipeline/workspace/metrics_json.h"
#include "reconstruct/scene/forward_facing.h"
#include "reconstruct/scene/scene_checks.h"

namespace regrade {
namespace {

constexpr double kAfterFit =
    0.08;  // pruning, writing and measuring, as a fraction of the steps' time
constexpr double kTrial = 0.08;    // the trial of degrees, likewise
constexpr double kGuesses = 0.08;  // a network's depths of the photos

// Measured; reads the photos' transparency.
PaperTraits TraitsOf(const Capture& capture) {
  return {ShowsThroughPhotos(capture),
          MeasureForwardFacing(WithParallax(capture, kLeastParallaxDeg)).on};
}

int64_t PixelsOf(const WorkingViews& views, const std::vector<int>& photos) {
  int64_t pixels = 0;
  for (const int i : photos) {
    const Camera camera = views.CameraOf(i);
    pixels += int64_t{camera.width} * camera.height;
  }
  return pixels;
}

FitPlace PlaceOf(const RunSettings& settings, const WorkingViews& views,
                 const std::vector<int>& photos) {
  return {.backend = ChooseBackend(settings.run.device, settings.run.reproducible),
          .pixels = PixelsOf(views, photos),
          .photos = std::ssize(photos),
          .max_memory_gb = settings.run.max_memory_gb,
          .reproducible = settings.run.reproducible};
}

// The photos that are fitted: of those that are not held out one in so many.
struct PhotosOfFit {
  std::vector<int> views;
  int64_t one_in = 1;
  std::string notice;  // if there are fewer for memory's sake
};

PhotosOfFit PhotosWithinMemory(const RunSettings& settings, const WorkingViews& views) {
  const std::vector<int> all = views.Training();
  const FitPlace place = PlaceOf(settings, views, all);
  PhotosOfFit fit{{}, OnePhotoIn(settings, place), ""};
  for (size_t i = 0; i < all.size(); i += static_cast<size_t>(fit.one_in))
    fit.views.push_back(all[i]);
  if (fit.one_in > 1) fit.notice = FewerPhotosText(fit.one_in, std::ssize(fit.views), place);
  return fit;
}

// Decides whether the fit keeps its spherical harmonics, with the evidence.
EffectReport ProfileViewDependence(const RunSettings& settings, FieldFit* fit,
                                   const std::vector<TrainingView>& views,
                                   const ProgressFunction& progress) {
  const auto row = [](bool on, const Metric& value, const std::string& evidence) {
    return EffectReport{kViewDependence, on, evidence, value, kDegreePays};
  };
  const auto overrides = ParseEffects(settings.run.effects);
  const auto override = overrides.find(kViewDependence);
  const bool allowed = override == overrides.end() || override->second;
  if (fit->sh_degree() == 0 || !allowed) return row(false, Metric(), "set by options");
  if (override != overrides.end()) return row(true, Metric(), "set by options");
  if (views.size() < kLeastTrialViews)
    return row(true, Metric(), "too few photos for a trial with held-out ones");
  const std::optional<DegreeTrial> trial = fit->TryHarmonics(views, progress);
  if (!trial) return row(true, Metric(), "splats keep their harmonics");
  if (!std::isfinite(trial->gain_db))
    return row(true, Metric(), "too few unmasked pixels for a trial with held-out photos");
  return row(
      trial->Pays(), trial->gain_db,
      Concat("dB that harmonics of degree ", fit->sh_degree(),
             " gain over one colour for all directions, in a small trial on a held-out fifth "
             "of the views"));
}

// Poses that were given may be fewer than COLMAP's must be.
void RequireEnough(const Capture& capture, int least, const std::string& poses) {
  const int64_t count = std::ssize(capture.views);
  if (count < least)
    throw SceneError(Concat(Counted(count, "photo"),
                            " with a pose, and a scene in 3D needs at least ", least),
                     poses,
                     Concat("give poses of more photos; --config '{\"pose-min-photos\": ",
                            count, "}' tries with fewer"));
}

StageOutcome Reconstruct(RunContext* context, const JsonValue& inputs,
                         const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->workspace;
  const WorkingViews as_taken = context->Views().AsTaken();
  const Capture& capture = as_taken.capture();
  RequireEnough(capture, settings.pose.min_photos, workspace.Path("poses"));
  SceneProfile profile = ProfileRun(settings, capture);
  const NormalizedScene& scene = profile.scene;
  const WorkingViews views =
      as_taken.WithGains(profile.gains).InField(scene.field_from_world, scene.ndc);
  if (!scene.notice.empty()) context->console->Info(scene.notice);
  for (const EffectReport& effect : profile.effects)
    if (effect.name != kViewDependence) context->console->Detail(EffectLine(effect));
  for (const std::string& notice : profile.notices) context->console->Info(notice);
  const PhotosOfFit chosen = PhotosWithinMemory(settings, views);
  const std::vector<int>& training = chosen.views;
  FitPlace place = PlaceOf(settings, views, training);
  place.box = scene.box;
  const Backend backend = place.backend;
  if (!chosen.notice.empty()) context->console->Info(chosen.notice);
  const std::unique_ptr<FieldFit> fit = FitKindOf(settings).make(settings, place);
  for (const std::string& sentence : fit->FitIntoMemory()) context->console->Info(sentence);

  std::vector<Image> photos;
  photos.reserve(training.size());
  std::vector<TrainingView> training_views;
  std::vector<std::string> depth_notes;
  std::vector<std::vector<SeenPoint>> seen =
      PointsOfViews(capture, training, scene.field_from_world, &depth_notes);
  const std::string& depth_network = settings.depth.network;
  ProgressParts parts(progress,
                      (depth_network.empty() ? 0 : kGuesses) + kTrial + 1 + kAfterFit);
  if (!depth_network.empty())
    AddGuessedDepths(depth_network, views, training, parts.Next(kGuesses), &seen, &depth_notes);
  for (const std::string& note : depth_notes) context->console->Info(note);
  MakeAhead(
      std::ssize(training), LargestPhotoBytes(capture),
      [&](int64_t f) { return views.PhotoToFit(training[static_cast<size_t>(f)]); },
      [&](int64_t f, Image photo) {
        const int i = training[static_cast<size_t>(f)];
        if (photo.empty())
          return context->console->Info(views.View(i).file +
                                        ": its mask leaves nothing to fit");
        photos.push_back(std::move(photo));
        training_views.push_back(
            {views.CameraOf(i), &photos.back(), std::move(seen[static_cast<size_t>(f)])});
      });

  FieldFitHooks hooks;  // its note is the row of view dependence: must survive a stop
  hooks.checkpoint = [&](const std::vector<std::string_view>& pieces) {
    workspace.SaveCheckpoint("reconstruct", inputs, pieces);
  };
  const auto bytes = workspace.LoadCheckpoint("reconstruct", inputs);
  const bool resumes = bytes && fit->UseCheckpoint(*bytes, &hooks.note);
  if (resumes) context->console->Info("reconstruct: continues from its checkpoint");
  if (training_views.empty())
    throw InputError(
        "leave nothing of any photo to fit",
        settings.pose.photo_masks.empty() ? "the masks" : settings.pose.photo_masks,
        "make the masks' white parts larger");
  EffectReport& view_dependence =
      *std::ranges::find(profile.effects, kViewDependence, &EffectReport::name);
  const ProgressFunction trial = parts.Next(kTrial);
  view_dependence = resumes ? EffectsOfRecord(ParseJson(hooks.note, "checkpoint")).at(0)
                            : ProfileViewDependence(settings, &*fit, training_views, trial);
  hooks.note = DumpJson(EffectsRecord({view_dependence}), -1);
  context->console->Detail(EffectLine(view_dependence));
  if (!view_dependence.on) fit->LimitDegree(0);
  hooks.progress = parts.Next(1);
  FittedField fitted = fit->Run(training_views, hooks);

  ReconstructReport metrics;
  metrics.device = DeviceName(backend);
  if (settings.run.preset == "paper") {
    const PaperChoice choice = ChoosePaperConfig(settings.run.paper_config, TraitsOf(capture));
    metrics.paper_config = choice.name + ": " + choice.reason;
  }
  fit->Describe(fitted.field, &metrics);
  {
    // Freed once it is written: what is measured is the file.
    const StoredField stored{std::move(fitted.field), scene.field_from_world, scene.ndc};
    WriteFieldFile(workspace.Path("field.npz"), stored);
  }
  StageOutcome outcome;
  outcome.outputs = {"field.npz"};
  outcome.metrics["effects"] = EffectsRecord(profile.effects);
  WriteGains(workspace.Path("poses"), capture, profile.exposure, profile.gains);
  if (!profile.gains.of_view.empty())
    outcome.outputs.push_back(std::string("poses/") + kExposureFile);
  metrics.rays = fitted.rays;
  metrics.psnr_train_db = fitted.psnr_train_db;
  metrics.rejected_voxels = fitted.rejected;
  metrics.psnr_at_steps = std::move(fitted.psnr_at_steps);
  const StoredField stored = ReadFieldFile(workspace.Path("field.npz"));
  MeasureFit(views, stored, backend, false, context->console, &metrics);
  PutMetrics(metrics, &outcome.metrics);
  return outcome;
}

// Sets what --preset paper decides, now that the capture is known.
void ChoosePaperSettings(RunContext* context) {
  RunSettings& settings = context->settings;
  if (settings.run.preset != "paper") return;
  const PaperChoice choice = ChoosePaperConfig(
      settings.run.paper_config, TraitsOf(ReadCapture(context->workspace->Path("poses"))));
  ApplyPaperChoice(choice, &context->options);
  context->console->Info("configuration of the paper: " + choice.name + ", " + choice.reason);
  for (const std::string& difference : NotToTheLetter(choice.name, DecidedValues(settings)))
    context->console->Info("not to the letter: " + difference);
}

}  // namespace

Stage ReconstructStage(RunContext* context) {
  if (std::optional<Stage> given = SourceOf(*context).reconstruct(context))
    return std::move(*given);
  ChoosePaperSettings(context);
  const RunOptions& run = context->settings.run;
  Stage stage;
  stage.name = "reconstruct";
  stage.inputs = JsonValue::Object{{"poses", context->ResultOf("pose")},
                                   {"options", OptionsOfFit(context->settings)},
                                   {"seed", run.seed},
                                   {"holdout", run.holdout},
                                   {"effects", run.effects},
                                   {"reproducible", run.reproducible}};
  if (const std::string& network = context->settings.depth.network; !network.empty())
    stage.inputs["depth_network"] = HashFile(network);
  stage.refuse_changes = true;
  const bool posed = context->workspace->Find("pose").has_value();
  if (posed && run.max_memory_gb > 0)
    if (const PhotosOfFit chosen = PhotosWithinMemory(context->settings, context->Views());
        chosen.one_in > 1)
      stage.inputs["one_photo_in"] = chosen.one_in;
  if (context->settings.start.dry_run) {
    const WorkingViews views = context->Views();
    const PhotosOfFit chosen = PhotosWithinMemory(context->settings, views);
    FitPlace place = PlaceOf(context->settings, views, chosen.views),
             of_all = PlaceOf(context->settings, views, views.Training());
    place.box = of_all.box = SceneOfRun(context->settings, views.capture()).box;
    stage.plan = "about " +
                 SizeText(FitKindOf(context->settings).plan(context->settings, place).memory) +
                 " of memory";
    if (const std::string warning = MemoryWarning(context->settings, of_all); !warning.empty())
      stage.plan_warnings.push_back(warning);
  }
  stage.work = [context, inputs = stage.inputs](const ProgressFunction& progress) {
    return Reconstruct(context, inputs, progress);
  };
  return stage;
}

}  // namespace regrade
