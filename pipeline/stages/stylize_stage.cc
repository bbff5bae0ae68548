// Stage "stylize": a network learns from views_2d/ how the field's colours change, and
// styled.npz is the same geometry in those colours; network.npz keeps the network.
#include <omp.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <utility>

#include "kernels/field/packed_grid.h"
#include "kernels/field/pad_sh_basis.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/photo_gains.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/network_checkpoint.h"
#include "pipeline/fields/network_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/run/plan.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/stages/object_edit.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/style_targets.h"
#include "pipeline/workspace/metrics_json.h"
#include "stylize/cuda/device_style.h"
#include "stylize/field/apply_network.h"
#include "stylize/field/base_map.h"
#include "stylize/field/blend_fields.h"
#include "stylize/field/volume_variance.h"
#include "stylize/image/monge_kantorovich.h"

namespace regrade {
namespace {

constexpr int kStyledBasis = 9;
constexpr double kVoting = 0.2;  // of the steps' time, roughly
constexpr double kAfterTraining =
    0.15;  // conclusion, and the network over the field, of the steps' time

Vec3f Mapped(const ColorMap& map, const Vec3f& color) {
  Vec3d mapped = map(color.Cast<double>());
  for (int c = 0; c < 3; ++c) mapped[c] = std::clamp(mapped[c], 0.0, 1.0);
  return mapped.Cast<float>();
}

// Pairs of neighbouring pixels, drawn for the measurement of what the propositions guarantee.
constexpr int64_t kVariancePairs = 4000;

VarianceGroupMetrics MetricsOfGroup(const VarianceGroup& group) {
  if (group.pairs == 0) return {};
  return {group.pairs, group.above, group.Gain(), group.largest_excess};
}

VarianceMetrics MetricsOfVariance(const RadianceField& source, const RadianceField& styled,
                                  const LipschitzNetwork& network,
                                  const std::vector<StyledTrainingView>& views, uint64_t seed) {
  std::vector<Camera> cameras;
  for (const StyledTrainingView& view : views) cameras.push_back(view.camera);
  const VarianceReport report = MeasureVariance(
      source, styled, network, NeighbouringPixels(cameras, kVariancePairs, seed),
      MarchOptions{source.step});
  return {MetricsOfGroup(report.inside), MetricsOfGroup(report.clamp),
          MetricsOfGroup(report.open), report.largest_share};
}

// Why the network is steeper than the colours' covariances tell, where it is.
std::string WhySteep(const TrainNetworkResult& trained) {
  constexpr double kSteep = 1.5;
  if (!(trained.local_lipschitz_sampled > kSteep * trained.k_est)) return "";
  const double of_map = trained.network.BaseNorm(),
               of_colors = trained.slopes.along_coefficients;
  const double of_places = trained.slopes.along_position;
  const char* reason = "the 2D method bends colours more than one map for all of them does";
  if (of_map > kSteep * trained.k_est)
    reason = "a colour map that follows the 2D method is that steep by itself";
  else if (of_places > of_colors - of_map)
    reason = "the 2D method maps the same colours differently in different views and places";
  char text[360];
  std::snprintf(
      text, sizeof text,
      "the largest slope seen, %.2f, is %.2f K_est: %s (the map alone %.2f; where it is "
      "steepest %.2f along coefficients and %.2f along positions)",
      trained.local_lipschitz_sampled, trained.local_lipschitz_sampled / trained.k_est, reason,
      of_map, of_colors, of_places);
  return text;
}

// An object's style that no view shows.
StageOutcome LeaveAsItWas(RunContext* context, const StoredField& stored,
                          const ObjectWeights& shares) {
  const Workspace& workspace = *context->workspace;
  context->console->Warn(
      "the masks agree on no part of the scene: it stays as it was. Look at --masks, or lower "
      "--mask-vote");
  WriteNetworkFile(workspace.Path("network.npz"),
                   {NetworkOfMap({}), 0, stored.field.background});
  WriteFieldFile(workspace.Path("styled.npz"), stored);
  WriteObjectFile(workspace.Path("object.npz"), shares);
  StageOutcome outcome;
  outcome.outputs = {"network.npz", "styled.npz", "object.npz"};
  PutMetrics(StylizeReport(), &outcome.metrics);
  return outcome;
}

StageOutcome Stylize(RunContext* context, const JsonValue& inputs,
                     const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->workspace;
  const Capture capture = ReadCapture(workspace.Path("poses"));
  StoredField stored = ReadFieldFile(workspace.Path("field.npz"));
  // A 2D method maps each view by itself, and what differs from view to view needs directions,
  // also where the scene's own colours do not.
  stored.field.appearance = PadShBasis(std::move(stored.field.appearance), kStyledBasis);
  ProgressParts parts(progress, 1 + kAfterTraining + (settings.object.On() ? kVoting : 0));
  const std::vector<int> indices = StyledViews(workspace, capture, settings.run.holdout);
  const std::unique_ptr<ObjectMasks> object = OpenObjectMasks(settings, capture);
  ObjectWeights shares;
  if (object != nullptr)
    shares = VoteForObject(settings, capture, indices, *object, stored.field,
                           stored.field_from_world, stored.ndc, parts.Next(kVoting));
  const StyleTargets style_targets =
      ReadStyleTargets(context, capture, stored, indices, object.get(), &shares);
  if (style_targets.views.empty()) return LeaveAsItWas(context, stored, shares);

  // What a ray sees behind the box is a colour of the scene too, unless the paper's letter is
  // asked for.
  const Vec3f source_background = stored.field.background;
  if (settings.network.recipe != "paper" && object == nullptr)
    stored.field.background = Mapped(style_targets.scene_map.map, stored.field.background);
  TrainNetworkOptions options = settings.network;
  options.seed = settings.run.seed;
  TrainingHooks hooks;
  hooks.progress = parts.Next(1);
  hooks.checkpoint = [&](const TrainingState& state) {
    workspace.SaveCheckpoint("stylize", inputs, PackTrainingState(state));
  };
  std::optional<TrainingState> resume;
  if (const auto bytes = workspace.LoadCheckpoint("stylize", inputs))
    resume = UnpackTrainingState(*bytes);
  if (resume) context->console->Info("stylize: goes on from its checkpoint");
  const Backend backend = ChooseBackend(settings.run.device, settings.run.reproducible);
  DeviceGrid device_field;
  if (backend == Backend::kCuda) device_field = UploadGrid(MakeFastGrid(stored.field));
  const TrainNetworkResult trained =
      TrainNetwork(stored.field, style_targets.views, style_targets.scene_map,
                   MarchOptions{stored.field.step}, options, hooks, resume ? &*resume : nullptr,
                   backend == Backend::kCuda ? &device_field : nullptr);
  for (const std::string& warning : trained.warnings) context->console->Warn(warning);

  WriteNetworkFile(workspace.Path("network.npz"),
                   {trained.network, trained.k_est, stored.field.background});
  RadianceField source{
      stored.field.geometry, {}, source_background, stored.field.near_clip, stored.field.step};
  Appearance restyled;
  if (backend == Backend::kCuda) {
    RestyleOnDevice(trained.network, &device_field);
    restyled = ToRadianceField(DownloadGrid(device_field)).appearance;
  } else {
    restyled = ApplyNetwork(trained.network, stored.field, parts.Next(kAfterTraining));
  }
  source.appearance = std::exchange(stored.field.appearance, std::move(restyled));
  StageOutcome outcome;
  StylizeReport metrics;
  outcome.outputs = {"network.npz", "styled.npz"};
  if (object != nullptr) {
    const RadianceField styled = std::move(stored.field);
    stored.field = MixFields(source, {&styled}, {1}, &shares.all);
    WriteObjectFile(workspace.Path("object.npz"), shares);
    outcome.outputs.push_back("object.npz");
    metrics.object_voxels = static_cast<int64_t>(
        std::count_if(shares.all.begin(), shares.all.end(), [](float e) { return e > 0; }));
  } else {
    std::filesystem::remove(workspace.Path("object.npz"));  // of an earlier style
  }
  WriteFieldFile(workspace.Path("styled.npz"), stored);
  metrics.device = DeviceName(backend);
  metrics.steps = trained.steps;
  metrics.rejected_steps = trained.rejected_steps;
  metrics.k_est = trained.k_est;
  metrics.bound = trained.bound;
  metrics.local_lipschitz_sampled = trained.local_lipschitz_sampled;
  for (size_t i = 0; i < trained.history.steps.size(); ++i)
    metrics.bound_at_steps.emplace_back(trained.history.steps[i], trained.history.bounds[i]);
  metrics.local_lipschitz_max = trained.local_lipschitz_max;
  metrics.local_lipschitz_of_map = trained.network.BaseNorm();
  metrics.local_lipschitz_along_coefficients = trained.slopes.along_coefficients;
  metrics.local_lipschitz_along_position = trained.slopes.along_position;
  // A network's guarantee is about what it alone has made, and is measured on voxels.
  if (object == nullptr && !source.geometry->spheres.on())
    metrics.variance = MetricsOfVariance(source, stored.field, trained.network,
                                         style_targets.views, settings.run.seed);
  metrics.psnr_train_db = trained.psnr_db;
  metrics.notices = style_targets.notices;
  for (const std::string& warning : trained.warnings) metrics.notices.push_back(warning);
  if (const std::string why = WhySteep(trained); !why.empty()) {
    context->console->Info(why);
    metrics.notices.push_back(why);
  }
  PutMetrics(metrics, &outcome.metrics);
  return outcome;
}

}  // namespace

Stage StylizeStage(RunContext* context) {
  const RunOptions& run = context->settings.run;
  Stage stage;
  stage.name = "stylize";
  stage.inputs = JsonValue::Object{
      {"field", context->ResultOf("reconstruct")},
      {"views_2d", context->ResultOf("style_2d")},
      {"options", OptionValues(context->settings.scene, context->settings.network)},
      {"seed", run.seed},
      {"holdout", run.holdout}};
  if (context->settings.object.On()) {
    stage.inputs["object"] = OptionValues(context->settings.object);
    stage.inputs["masks"] = MaskFiles(context->settings.object);
  }
  stage.plan = PlanText(PlanStyle(context->settings.network.steps, omp_get_max_threads()));
  stage.work = [context, inputs = stage.inputs](const ProgressFunction& progress) {
    return Stylize(context, inputs, progress);
  };
  return stage;
}

}  // namespace regrade
