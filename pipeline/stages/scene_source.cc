#include "pipeline/stages/scene_source.h"

#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/fields/read_splats.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/run/fit_kind.h"
#include "pipeline/stages/foreign_splats.h"
#include "pipeline/stages/given_field.h"
#include "pipeline/stages/splat_points.h"
#include "pipeline/stages/splat_views.h"

namespace regrade {
namespace {

void ProbePhotos(RunContext* context) {
  const SplatInput& given = context->settings.splat_input;
  if (given.cameras.empty() && given.up == "auto") return;
  throw UsageError("belongs to a file of splats", given.cameras.empty() ? "--up" : "--cameras",
                   "leave it out, or give a file of splats in place of photos");
}

constexpr SceneSource kPhotos{
    .pose_effects = "",
    .has_points = false,
    .read_seconds = {},
    .probe = ProbePhotos,
    .capture = [](const RunContext& context) { return context.source; },
    .size = [](const RunContext&) { return std::optional<CaptureSize>(); },
    .pose = [](RunContext*) { return std::optional<Stage>(); },
    .reconstruct = [](RunContext*) { return std::optional<Stage>(); },
    .hash = [](const RunContext&) { return JsonValue(); },
    .add_points = nullptr};

// What decides a fit decides nothing here.
void RefuseFlagsOfFits(const OptionSet& options) {
  if (options.Given("depth-network"))
    throw UsageError("a file of splats is not fitted", "--depth-network", "leave it out");
  for (const FitKind* kind : FitKinds()) {
    const JsonValue of_fit = kind->options({});
    for (const auto& [name, value] : of_fit.AsObject())
      if (options.Given(name))
        throw UsageError("a file of splats is not fitted", "--" + name, "leave it out");
  }
}

void ProbeSplats(RunContext* context) {
  RunSettings& settings = context->settings;
  RefuseFlagsOfFits(context->options);
  std::string& cameras = settings.splat_input.cameras;
  if (settings.scene.Kind().lattice)
    throw UsageError("splats do not become voxels", context->source,
                     "leave out --field voxels and --preset paper");
  if (cameras.empty()) return;
  if (settings.splat_input.up != "auto")
    throw UsageError("the cameras know what is up", "--up and --cameras",
                     "leave one of them out");
  if (!std::filesystem::exists(cameras))
    throw InputError("there is no such folder or file", cameras,
                     "name a capture with cameras, or leave --cameras out");
  cameras = std::filesystem::absolute(cameras).lexically_normal().string();
  HasPhotosOfSplats(*context);
}

std::optional<CaptureSize> SizeOfViews(const RunContext& context) {
  if (HasPhotosOfSplats(context)) return std::nullopt;
  return SizeOfSplatViews(context);
}

std::optional<Stage> ViewsOfSplats(RunContext* context) {
  if (HasPhotosOfSplats(*context)) return std::nullopt;
  return SplatViewsStage(context);
}

void AddPointsOfSplats(const RunContext& context, const std::string& sparse_folder,
                       const std::string& cameras, Capture* capture) {
  const RunOptions& run = context.settings.run;
  const RadianceField field =
      FieldInItsWorld(ReadForeignSplats(context.source, run.max_memory_gb, context.console));
  const FieldRenderer renderer(field, ChooseBackend(run.device, run.reproducible));
  AddSplatPoints(field, renderer, sparse_folder, cameras, capture);
}

constexpr SceneSource kSplats{
    .pose_effects = ",pose-refinement=off",  // splats lie in the world of the poses as they are
    .has_points = true,
    .read_seconds = 5,
    .probe = ProbeSplats,
    .capture = [](const RunContext& context) { return context.settings.splat_input.cameras; },
    .size = SizeOfViews,
    .pose = ViewsOfSplats,
    .reconstruct = [](RunContext* context) { return std::optional(GivenFieldStage(context)); },
    .hash = [](const RunContext& context) { return JsonValue(HashFile(context.source)); },
    .add_points = AddPointsOfSplats};

}  // namespace

const SceneSource& SourceOf(const RunContext& context) {
  return IsSplatFile(context.source) ? kSplats : kPhotos;
}

}  // namespace regrade
