// Stage "stylize": trains a network on the pictures of views_2d/ and writes it to network.npz,
// and what it lacks to residual.npz where --residual asks for that; styled_field.h makes the
// styled field from both.
#include <algorithm>
#include <filesystem>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/base/parallel_tasks.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/network_checkpoint.h"
#include "pipeline/fields/network_file.h"
#include "pipeline/fields/residual_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/run/paper_config.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/stages/object_edit.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/style_residual.h"
#include "pipeline/stages/style_targets.h"
#include "pipeline/stages/trained_views.h"
#include "pipeline/workspace/metrics_json.h"
#include "pipeline/workspace/output_names.h"
#include "stylize/field/base_map.h"
#include "stylize/field/volume_variance.h"
#include "stylize/training/restyle_field.h"

namespace regrade {
namespace {

constexpr double kVoting = 0.2;      // of the time of training and application, roughly
constexpr double kOfResidual = 0.5;  // likewise

// Pairs of pixels on which LipRF's propositions are checked: so many neighbours, and as many of
// two views.
constexpr int64_t kVariancePairs = 4000;

VarianceGroupMetrics MetricsOfGroup(const VarianceGroup& group) {
  if (group.pairs == 0) return {};
  return {group.pairs, group.above, group.Gain(), group.largest_excess};
}

VarianceMetrics MetricsOfVariance(const VarianceReport& report) {
  VarianceMetrics metrics{MetricsOfGroup(report.valid), MetricsOfGroup(report.clamped),
                          MetricsOfGroup(report.transparent), report.largest_fraction};
  if (report.spheres.pairs > 0) metrics.spheres = MetricsOfGroup(report.spheres);
  if (report.partial.pairs > 0) metrics.partial = MetricsOfGroup(report.partial);
  return metrics;
}

void SetVariance(const RestyledField& restyled, const std::vector<StyledTrainingView>& views,
                 uint64_t seed, const std::vector<float>* object_weights, RayWeigher* weigher,
                 StylizeReport* metrics) {
  std::vector<Camera> cameras;
  for (const StyledTrainingView& view : views) cameras.push_back(view.camera);
  const RadianceField& source = restyled.source;
  const auto measure = [&](const RayPairs& pairs) {
    return MetricsOfVariance(MeasureVariance(source, restyled.styled, restyled.trained.network,
                                             pairs, weigher, object_weights));
  };
  metrics->variance = measure(NeighbouringPixels(cameras, kVariancePairs, seed));
  metrics->variance_across_views =
      measure(PixelsOfOnePoint(source, cameras, kVariancePairs, seed, weigher));
}

// Why the local Lipschitz constant is above what the colours' covariances predict, where it is.
std::string WhySteep(const TrainNetworkResult& trained) {
  constexpr double kSteep = 1.5;
  if (!(trained.local_lipschitz_sampled > kSteep * trained.k_est)) return "";
  const double of_map = trained.network.BaseNorm(),
               of_colors = trained.local_lipschitz.along_coefficients;
  const double of_places = trained.local_lipschitz.along_position;
  const char* reason = "the 2D method varies more with colour than one colour map does";
  if (of_map > kSteep * trained.k_est)
    reason = "the colour map that follows the 2D method already has such a norm";
  else if (of_places > of_colors - of_map)
    reason = "the 2D method maps the same colours differently in different views and places";
  return Format(
      "the largest local Lipschitz constant, %.2f, is %.2f K_est: %s (the map alone "
      "%.2f; at its maximum %.2f along coefficients and %.2f along positions)",
      trained.local_lipschitz_sampled, trained.local_lipschitz_sampled / trained.k_est, reason,
      of_map, of_colors, of_places);
}

// Where no view shows the object: the scene keeps its colours.
StageOutcome KeepColors(RunContext* context, const Vec3f& background,
                        const ObjectWeights& weights) {
  const Workspace& folder = *context->style;
  context->console->Warn(
      "the masks agree on no part of the scene: it keeps its colours. Check --masks, or lower "
      "the constant mask-vote (--config)");
  WriteNetworkFile(folder.Path("network.npz"), {NetworkOfMap({}), 0, background});
  WriteObjectFile(folder.Path("object.npz"), weights);
  StageOutcome outcome;
  outcome.outputs = {"network.npz", "object.npz"};
  PutMetrics(StylizeReport(), &outcome.metrics);
  return outcome;
}

// The views `indices` with their pictures in views_2d/.
StyleTargets ReadStyleTargets(const Workspace& folder, const WorkingViews& views,
                              const RadianceField& field, const std::vector<int>& indices,
                              const ObjectMasks* object, const ObjectWeights& weights) {
  StyleTargets targets(field, object, &weights);
  const auto name = [](int view) { return "views_2d/" + FrameName(view); };
  using Pictures = std::pair<Image, Image>;
  MakeAhead(
      std::ssize(indices), LargestPhotoBytes(views.capture()),
      [&](int64_t k) -> Pictures {
        const int i = indices[static_cast<size_t>(k)];
        return {views.Photo(i), ReadImage(folder.Path(name(i)))};
      },
      [&](int64_t k, Pictures pictures) {
        const int i = indices[static_cast<size_t>(k)];
        targets.Add({i, views.CameraOf(i), name(i), views.Mask(i),
                     [&] { return std::move(pictures.first); },
                     [&] { return std::move(pictures.second); }});
      });
  return targets;
}

// `metrics` has what was checked.
StylizeReport MetricsOfTraining(const TrainNetworkResult& trained, StylizeReport metrics) {
  metrics.steps = trained.steps;
  metrics.rejected_steps = trained.rejected_steps;
  metrics.k_est = trained.k_est;
  metrics.bound = trained.bound;
  metrics.local_lipschitz_sampled = trained.local_lipschitz_sampled;
  for (size_t i = 0; i < trained.history.steps.size(); ++i)
    metrics.bound_at_steps.emplace_back(trained.history.steps[i], trained.history.bounds[i]);
  metrics.local_lipschitz_max = trained.local_lipschitz_max;
  metrics.local_lipschitz_of_map = trained.network.BaseNorm();
  metrics.local_lipschitz_along_coefficients = trained.local_lipschitz.along_coefficients;
  metrics.local_lipschitz_along_position = trained.local_lipschitz.along_position;
  metrics.psnr_train_db = trained.psnr_db;
  return metrics;
}

StageOutcome Stylize(RunContext* context, const JsonValue& inputs,
                     const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->style;
  StoredField geometry = ReadFieldGeometry(context->workspace->Path("field.npz"));
  const WorkingViews views = context->Views().InField(geometry);
  ProgressParts parts(progress, 1 + (settings.object.On() ? kVoting : 0) +
                                    (settings.residual.On() ? kOfResidual : 0));
  TrainedField trained_on =
      ReadTrainedField(*context, std::move(geometry), views, StyledViews(workspace, views));
  if (!trained_on.notice.empty()) context->console->Warn(trained_on.notice);
  StoredField& stored = trained_on.stored;
  const std::vector<int>& indices = trained_on.views;
  const std::unique_ptr<ObjectMasks> object = OpenObjectMasks(settings, views);
  ObjectWeights weights;
  if (object != nullptr)
    weights =
        VoteForObject(settings, views, indices, *object, stored.field, parts.Next(kVoting));
  const StyleTargets targets =
      ReadStyleTargets(workspace, views, stored.field, indices, object.get(), weights);
  if (targets.targets().empty()) return KeepColors(context, stored.field.background, weights);

  RestyleRequest request;
  request.options = settings.network;
  request.options.seed = settings.run.seed;
  request.backend = ChooseBackend(settings.run.device, settings.run.reproducible);
  if (object != nullptr) request.object_weights = &weights.all;
  if (views.capture().rendered) request.options.map_background = false;  // nothing is there
  RestyleHooks hooks;
  hooks.training.progress = parts.Next(1);
  hooks.training.checkpoint = [&](const TrainingState& state) {
    workspace.SaveCheckpoint("stylize", inputs, {PackTrainingState(state)});
  };
  std::optional<TrainingState> resume;
  if (const auto bytes = workspace.LoadCheckpoint("stylize", inputs))
    resume = UnpackTrainingState(*bytes);
  if (resume) context->console->Info("stylize: continues from its checkpoint");
  request.resume = resume ? &*resume : nullptr;
  StylizeReport checked;
  hooks.check = [&](const RestyledField& restyled, RayWeigher* weigher) {
    SetVariance(restyled, targets.targets().views(), settings.run.seed, request.object_weights,
                weigher, &checked);
  };
  const RestyledField restyled =
      Restyle(std::move(stored.field), targets.targets(), request, hooks);
  const TrainNetworkResult& trained = restyled.trained;
  for (const std::string& notice : restyled.notices) context->console->Info(notice);
  for (const std::string& warning : trained.warnings) context->console->Warn(warning);

  const StoredNetwork network{trained.network, trained.k_est, restyled.styled.background};
  WriteNetworkFile(workspace.Path("network.npz"), network);
  StageOutcome outcome;
  StylizeReport metrics = MetricsOfTraining(trained, std::move(checked));
  outcome.outputs = {"network.npz"};
  std::filesystem::remove(workspace.Path("residual.npz"));  // of an earlier style
  if (settings.residual.On()) {
    const StoredField source = ReadFieldFile(context->workspace->Path("field.npz"));
    WriteResidualFile(
        workspace.Path("residual.npz"),
        FitStyleResidual(context, views, source, network, indices, parts.Next(kOfResidual)));
    outcome.outputs.push_back("residual.npz");
  }
  if (object != nullptr) {
    WriteObjectFile(workspace.Path("object.npz"), weights);
    outcome.outputs.push_back("object.npz");
    metrics.object_voxels =
        static_cast<int64_t>(std::ranges::count_if(weights.all, [](float e) { return e > 0; }));
  } else {
    std::filesystem::remove(workspace.Path("object.npz"));  // of an earlier style
  }
  if (request.options.loss_scale == "sum-over-voxels" && trained.loss_balance) {
    metrics.loss_balance = trained.loss_balance;
    context->console->Info(Format(
        "3 Q / B, rays times channels of a step over what the network maps, is %.3g: where it "
        "is above 1 the regularisation hardly counts",
        *trained.loss_balance));
  }
  metrics.device = DeviceName(request.backend);
  metrics.notices = restyled.notices;
  if (!trained_on.notice.empty()) metrics.notices.push_back(trained_on.notice);
  for (const std::string& warning : trained.warnings) metrics.notices.push_back(warning);
  if (const std::string why = WhySteep(trained); !why.empty()) {
    context->console->Detail(why);
    metrics.notices.push_back(why);
  }
  metrics.not_to_the_letter = SayIfPaper(settings, RecipeValues(settings), context->console);
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
  const std::string field = context->workspace->Path("field.npz");
  if (std::filesystem::exists(field) && IsTrainedOnAPart(context->settings, CountSplats(field)))
    stage.inputs["max-memory"] = run.max_memory_gb;
  if (context->settings.object.On()) {
    stage.inputs["object"] = OptionValues(context->settings.object);
    stage.inputs["masks"] = MaskFiles(context->settings.object);
  }
  if (context->settings.residual.On())
    stage.inputs["residual"] = ResidualInputs(context->settings.residual);
  stage.work = [context, inputs = stage.inputs](const ProgressFunction& progress) {
    return Stylize(context, inputs, progress);
  };
  return stage;
}

}  // namespace regrade
