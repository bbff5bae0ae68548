// Stage "evaluate": temporal consistency of the rendered sequences, and beside it how much of
// the style they kept.
#include <filesystem>
#include <optional>

#include "evaluate/consistency.h"
#include "evaluate/fidelity.h"
#include "evaluate/image_quality.h"
#include "evaluate/pair_network.h"
#include "evaluate/tables.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/packed_grid.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/report/records.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/heat_map_files.h"
#include "pipeline/stages/linear_map_baseline.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/stages/stages.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

// Pictures `folder`/00000.png, ..., of the given views.
FrameSource FramesOf(const std::string& folder, const std::vector<int>& views) {
  return {static_cast<int>(views.size()), [folder, views](int i) {
            return ReadImage(folder + "/" + FrameName(views[static_cast<size_t>(i)]));
          }};
}

// Depth and camera of each view, rendered when they are asked for.
GeometrySource GeometryOf(const RunSettings& settings, const Capture& capture,
                          const StoredField& stored) {
  const auto grid = std::make_shared<const FastGrid>(MakeFastGrid(stored.field));
  return
      [&settings, &capture, grid, step = stored.field.step,
       field_from_world = stored.field_from_world, ndc = stored.ndc](int i) -> FrameGeometry {
        const Camera camera = WorkingCamera(capture.views[static_cast<size_t>(i)].camera,
                                            settings.scene.photo_size, field_from_world, ndc);
        return {DepthAlongRays(camera, RenderView(*grid, camera, MarchOptions{step}).depth),
                camera};
      };
}

// Seconds on two cores at 480 pixels, roughly: what makes the stage's time left come out right.
constexpr double kPairSeconds = 0.085, kFrameSeconds = 0.07, kLinearMapSeconds = 0.23;

double PairWeight(const RunSettings& settings, int frames) {
  double weight = 0;
  for (const int gap : settings.consistency.gaps)
    weight += kPairSeconds * std::max(0, frames - gap);
  return std::max(weight, kPairSeconds);
}

bool HasFilm(const RunSettings& settings) {
  return settings.render.path.path != "views" && settings.consistency.mode != "geometry";
}

// The film's frames, with flow and masks from its own unstyled ones. Its geometry is not on
// disk, so "geometry" leaves it out.
void AddFilm(RunContext* context, const Image& style, ProgressParts* parts,
             ConsistencyReport* report, std::vector<FidelityRow>* fidelity,
             std::vector<HeatMapFile>* heat_maps) {
  const RunSettings& settings = context->settings;
  if (!HasFilm(settings)) return;
  std::vector<int> all(static_cast<size_t>(settings.render.path.path_frames));
  for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  const auto folder = [&](const char* name) {
    return context->workspace->Path(std::string("frames/") + kPathPrefix + name);
  };
  const bool renders_styled = std::filesystem::exists(folder("views_2d"));
  std::vector<NamedFrameSource> sequences;
  for (const char* name : {"source", "views_2d", "styled"}) {
    if (name == std::string("views_2d") && !renders_styled) continue;
    const std::string sequence = std::string(kPathPrefix) + name;
    sequences.push_back({sequence, FramesOf(folder(name), all)});
  }
  const ConsistencyReport film =
      EvaluateConsistency(sequences[0].frames, sequences, settings.consistency,
                          parts->Next(PairWeight(settings, static_cast<int>(all.size()))), {});
  const ConsistencyOptions& options = settings.consistency;
  const std::vector<HeatMapFile> maps = WriteHeatMaps(
      *context->workspace, EstimatedMotion(sequences[0].frames, options.mode, options.flow),
      sequences, options.gaps, film);
  heat_maps->insert(heat_maps->end(), maps.begin(), maps.end());
  report->rows.insert(report->rows.end(), film.rows.begin(), film.rows.end());
  report->pairs.insert(report->pairs.end(), film.pairs.begin(), film.pairs.end());
  const FidelityTargets targets{renders_styled ? sequences[1].frames : FrameSource(),
                                FramesOf(folder("transmittance"), all), &style,
                                PerceptualDistance(settings.consistency.lpips),
                                sequences[0].frames};
  for (const NamedFrameSource& sequence : sequences)
    fidelity->push_back(MeasureFidelity(
        sequence, targets, parts->Next(kFrameSeconds * static_cast<double>(all.size()))));
}

StageOutcome Evaluate(RunContext* context, const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->workspace;
  const Capture capture = ReadCapture(workspace.Path("poses"));
  const StoredField stored = ReadFieldFile(workspace.Path("field.npz"));
  std::vector<int> all(capture.views.size());
  for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  const std::vector<int> taught = StyledViews(workspace, capture, settings.run.holdout);
  const auto frames = [&](const char* sequence, const std::vector<int>& views) {
    return FramesOf(workspace.Path(std::string("frames/") + sequence), views);
  };

  const double n = static_cast<double>(taught.size());
  const int film = HasFilm(settings) ? settings.render.path.path_frames : 0;
  double weight = PairWeight(settings, static_cast<int>(all.size())) +
                  n * (4 * kFrameSeconds + kLinearMapSeconds);
  if (film > 0) weight += PairWeight(settings, film) + 3 * kFrameSeconds * film;
  ProgressParts parts(progress, weight);

  const FrameSource source = frames("source", all);
  // A method that only knows pictures of photos made nothing of our renders.
  const bool renders_styled = std::filesystem::exists(workspace.Path("frames/views_2d"));
  std::vector<NamedFrameSource> sequences = {{"source", source}};
  if (renders_styled) sequences.push_back({"views_2d", frames("views_2d", all)});
  sequences.push_back({"styled", frames("styled", all)});
  const GeometrySource geometry = settings.consistency.mode == "geometry"
                                      ? GeometryOf(settings, capture, stored)
                                      : GeometrySource();
  ConsistencyReport consistency = EvaluateConsistency(
      source, sequences, settings.consistency,
      parts.Next(PairWeight(settings, static_cast<int>(all.size()))), geometry);

  BeginHeatMaps(workspace);
  std::vector<HeatMapFile> heat_maps = WriteHeatMaps(
      workspace,
      geometry ? KnownMotion(geometry)
               : EstimatedMotion(source, settings.consistency.mode, settings.consistency.flow),
      sequences, settings.consistency.gaps, consistency);

  // Fidelity is measured on the views that the style was learned from, against what the 2D
  // method made of the renders, or else of the photos.
  const Image style = ReadStylePicture(settings.style.picture, nullptr);
  const FrameSource of_photos{
      static_cast<int>(taught.size()), [&](int k) {
        const size_t i = static_cast<size_t>(taught[static_cast<size_t>(k)]);
        Image picture = ReadImage(workspace.Path("views_2d/" + FrameName(static_cast<int>(i))));
        LeaveOutMasked(capture.views[i], settings.scene.photo_size, &picture);
        return picture;
      }};
  const FidelityTargets targets{
      renders_styled ? frames("views_2d", taught) : of_photos, frames("transmittance", taught),
      &style, PerceptualDistance(settings.consistency.lpips), frames("source", taught)};
  std::vector<FidelityRow> fidelity;
  for (const NamedFrameSource& sequence : sequences)
    fidelity.push_back(MeasureFidelity({sequence.name, frames(sequence.name.c_str(), taught)},
                                       targets, parts.Next(n * kFrameSeconds)));
  AddFilm(context, style, &parts, &consistency, &fidelity, &heat_maps);
  const FidelityTargets photo_targets{of_photos, targets.transmittance, nullptr, {}, {}};
  const FidelityRow to_photos = MeasureFidelity({"styled", frames("styled", taught)},
                                                photo_targets, parts.Next(n * kFrameSeconds));

  std::vector<Camera> cameras;
  for (const int i : taught)
    cameras.push_back(WorkingCamera(capture.views[static_cast<size_t>(i)].camera,
                                    settings.scene.photo_size, stored.field_from_world,
                                    stored.ndc));
  // One map for the whole scene is no yardstick of an object's style.
  std::optional<double> linear_map;
  if (!settings.object.On())
    linear_map =
        LinearMapPsnr(stored.field, cameras, frames("source", taught), targets.views_2d,
                      targets.transmittance, parts.Next(n * kLinearMapSeconds));

  context->console->Lines(FormatTables(consistency, fidelity));
  StageOutcome outcome;
  outcome.outputs = {kHeatMapFolder};
  outcome.figures = EvaluationRecord(consistency, fidelity, heat_maps);
  outcome.figures["flow"] = settings.consistency.flow;
  outcome.figures["mask"] = settings.consistency.mode;
  outcome.figures["psnr_to_2d_photos_db"] =
      to_photos.psnr_to_2d_db ? JsonValue(*to_photos.psnr_to_2d_db) : JsonValue();
  outcome.figures["linear_map_psnr_to_2d_db"] =
      linear_map ? JsonValue(*linear_map) : JsonValue();
  return outcome;
}

}  // namespace

Stage EvaluateStage(RunContext* context) {
  Stage stage;
  stage.name = "evaluate";
  stage.inputs = JsonValue::Object{{"frames", context->ResultOf("render")},
                                   {"views_2d", context->ResultOf("style_2d")},
                                   {"style", HashFile(context->settings.style.picture)},
                                   {"holdout", context->settings.run.holdout},
                                   {"options", context->OptionsOf({"Evaluation"})}};
  stage.work = [context](const ProgressFunction& progress) {
    return Evaluate(context, progress);
  };
  return stage;
}

}  // namespace regrade
