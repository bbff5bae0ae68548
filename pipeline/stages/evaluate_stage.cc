// Stage "evaluate": temporal consistency of the rendered sequences and their fidelity to the 2D
// method.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <iterator>
#include <optional>

#include "evaluate/consistency.h"
#include "evaluate/fidelity.h"
#include "evaluate/fidelity_networks.h"
#include "evaluate/optical_flow.h"
#include "evaluate/protocols.h"
#include "evaluate/tables.h"
#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "kernels/scene/common_camera.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/film_timing.h"
#include "pipeline/images/cube_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/images/kept_pictures.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/report/records.h"
#include "pipeline/run/paper_config.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/carried_edit.h"
#include "pipeline/stages/control_field.h"
#include "pipeline/stages/control_sequences.h"
#include "pipeline/stages/film_frames.h"
#include "pipeline/stages/frame_gains.h"
#include "pipeline/stages/heat_map_files.h"
#include "pipeline/stages/linear_map_baseline.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/stages/photo_metrics.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/style_pictures.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/workspace/metrics_json.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

// The pictures `folder`/00000.png, ... of the given views.
FrameSource FramesOf(const KeptPictures& kept, const std::string& folder,
                     const std::vector<int>& views) {
  std::vector<std::string> paths;
  for (const int i : views) paths.push_back(folder + "/" + FrameName(i));
  kept.ReadAhead(paths);
  return {static_cast<int>(paths.size()),
          [kept, paths](int i) { return kept.Read(paths[static_cast<size_t>(i)]); }};
}

void Append(std::vector<NamedFrameSource> more, std::vector<NamedFrameSource>* sequences) {
  std::ranges::move(more, std::back_inserter(*sequences));
}

// Depth at each camera, rendered on demand.
GeometrySource GeometryOf(const RadianceField& field, const std::vector<Camera>& cameras) {
  const auto renderer = std::make_shared<const FieldRenderer>(field, Backend::kCpu);
  return [renderer, cameras](int i) -> FrameGeometry {
    const Camera& camera = cameras[i];
    return {DepthAlongRays(camera, renderer->Render(camera).depth), camera};
  };
}

// Why optical flow cannot be computed on frames of this camera; empty where it can.
std::string TooSmallForFlow(const Camera& camera, const ConsistencyOptions& options) {
  if (options.mode == "geometry" || options.flow.find(':') != std::string::npos) return "";
  if (std::min(camera.width, camera.height) >= kLeastFlowSide) return "";
  return Concat("frames of ", camera.width, " x ", camera.height,
                " px are too small for optical flow, which needs ", kLeastFlowSide,
                " px a side");
}

// Compares the sequences of one set of frames and writes heat maps of their worst pairs. The
// first sequence is the unstyled one; all frames have `camera`; without `geometry` motion is
// estimated.
ConsistencyReport Compare(const Workspace& workspace,
                          const std::vector<NamedFrameSource>& sequences, const Camera& camera,
                          const GeometrySource& geometry, const ConsistencyOptions& options,
                          const ProgressFunction& progress,
                          std::vector<HeatMapFile>* heat_maps) {
  const FrameSource& reference = sequences[0].frames;
  if (const std::string why = TooSmallForFlow(camera, options); !why.empty())
    return UndefinedConsistency(reference.count, sequences, options, why);
  ConsistencyReport report =
      EvaluateConsistency(reference, sequences, options, progress, geometry);
  const std::vector<HeatMapFile> maps = WriteHeatMaps(workspace, sequences, report);
  heat_maps->insert(heat_maps->end(), maps.begin(), maps.end());
  return report;
}

// Rough seconds on two cores at 480 pixels, for the estimate of the remaining time.
constexpr double kControlFieldSeconds = 60, kCeilingSeconds = 60;
constexpr double kPairSeconds = 0.085, kFrameSeconds = 0.07, kLinearMapSeconds = 0.23;

double PairWeight(const RunSettings& settings, int frames) {
  double weight = 0;
  for (const int gap : settings.consistency.gaps)
    weight += kPairSeconds * std::max(0, frames - gap);
  return std::max(weight, kPairSeconds);
}

// Evaluates the film's frames, with flow and masks from its own unstyled ones. Mode "geometry"
// leaves the film out: its geometry is not on disk.
void AddFilm(RunContext* context, const FidelityTargets& networks, const Camera& camera,
             ProgressParts* parts, ConsistencyReport* report,
             std::vector<FidelityRow>* fidelity, std::vector<HeatMapFile>* heat_maps) {
  const RunSettings& settings = context->settings;
  if (!MeasuresFilm(settings)) return;
  std::vector<int> all(CountSamples(settings.render));
  for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  const auto folder = [&](const char* name) {
    return context->style->Path(std::string("frames/") + kPathPrefix + name);
  };
  ConsistencyOptions options = settings.consistency;
  options.excerpt = SamplesOfFilm(settings.render.film_seconds, settings.render.fps).excerpt;
  const bool renders_styled = std::filesystem::exists(folder("views_2d"));
  const KeptPictures kept(KeptPictures::Origin::kOurs);
  std::vector<NamedFrameSource> sequences;
  for (const char* name : {"source", "views_2d", "styled"}) {
    if (name == std::string("views_2d") && !renders_styled) continue;
    const std::string sequence = std::string(kPathPrefix) + name;
    sequences.push_back({sequence, FramesOf(kept, folder(name), all)});
  }
  FidelityTargets targets = networks;
  if (renders_styled) targets.views_2d = sequences[1].frames;
  if (std::filesystem::exists(folder(kEditedFrames)))
    targets.views_2d =
        WhereEdited(targets.views_2d, FramesOf(kept, folder(kEditedFrames), all));
  targets.transmittance = FramesOf(kept, folder("transmittance"), all);
  targets.unstyled = sequences[0].frames;
  if (options.HasControls())
    Append(ControlSequences({sequences[0].frames, sequences.back().frames, targets.views_2d,
                             targets.style, !settings.object.On()},
                            kPathPrefix),
           &sequences);
  const ConsistencyReport film =
      Compare(*context->style, sequences, camera, {}, options,
              parts->Next(PairWeight(settings, static_cast<int>(all.size()))), heat_maps);
  report->rows.insert(report->rows.end(), film.rows.begin(), film.rows.end());
  report->pairs.insert(report->pairs.end(), film.pairs.begin(), film.pairs.end());
  report->warped.insert(report->warped.end(), film.warped.begin(), film.warped.end());
  report->warped_pairs.insert(report->warped_pairs.end(), film.warped_pairs.begin(),
                              film.warped_pairs.end());
  const double frames = static_cast<double>(sequences.size() * all.size());
  std::ranges::move(MeasureFidelities(sequences, targets, parts->Next(kFrameSeconds * frames)),
                    std::back_inserter(*fidelity));
}

// Rows of --controls that the table of neighbouring views cannot have. `map_has_target`: there
// is a picture, or the 2D method's frames, that one map of colours could lead to.
std::vector<MissingControl> MissingControls(const RunSettings& settings, bool map_has_target,
                                            bool same_camera) {
  std::vector<MissingControl> missing;
  if (!settings.consistency.HasControls()) return missing;
  if (settings.object.On())
    missing.push_back({kLinearMapControl, "only a part of the scene is styled"});
  else if (!map_has_target)
    missing.push_back(
        {kLinearMapControl, "the 2D method styles no renders and the style is no picture"});
  if (!same_camera)
    for (const char* name : {"photos", "photos_2d"})
      missing.push_back({name, "neighbouring photos differ in size or lens"});
  return missing;
}

StageOutcome Evaluate(RunContext* context, const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->style;
  const StoredField stored = ReadFieldFile(context->workspace->Path("field.npz"));
  const WorkingViews views = context->Views().InField(stored);
  std::vector<int> all(views.count());
  for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  const std::vector<int> training_views = StyledViews(workspace, views);
  const KeptPictures kept(KeptPictures::Origin::kOurs);
  const auto frames = [&](const char* sequence, const std::vector<int>& views) {
    return FramesOf(kept, workspace.Path(std::string("frames/") + sequence), views);
  };

  const std::vector<Camera> cameras = views.Cameras();
  const bool same_camera = HaveSameIntrinsics(cameras);
  const std::vector<Camera> compared = WithCommonIntrinsics(cameras);

  const double n = static_cast<double>(training_views.size());
  const int film = MeasuresFilm(settings) ? CountSamples(settings.render) : 0;
  double weight = PairWeight(settings, static_cast<int>(all.size())) +
                  n * (4 * kFrameSeconds + kLinearMapSeconds);
  if (film > 0) weight += PairWeight(settings, film) + 3 * kFrameSeconds * film;
  if (settings.consistency.HasControlField()) weight += kControlFieldSeconds;
  if (settings.consistency.HasControls()) weight += kCeilingSeconds;
  ProgressParts parts(progress, weight);

  // A method that styles photos only has no pictures of rendered frames.
  const bool renders_styled = std::filesystem::exists(workspace.Path("frames/views_2d"));
  std::vector<NamedFrameSource> sequences;
  for (const char* name : {"source", "views_2d", "styled"}) {
    if (name == std::string("views_2d") && !renders_styled) continue;
    const std::string folder = (same_camera ? "" : kCommonPrefix) + std::string(name);
    sequences.push_back({name, frames(folder.c_str(), all)});
  }
  const bool of_picture = !IsCubeFile(settings.style.picture());  // not a LUT
  const Image style = of_picture ? StyleExampleOf(settings.style, nullptr) : Image();
  const auto photo_2d = [&](int i) {
    Image picture = kept.Read(workspace.Path("views_2d/" + FrameName(i)));
    if (settings.style.strength != 1)
      MixPicture(views.Photo(i), settings.style.strength, &picture);
    views.LeaveOutMasked(i, &picture);
    return picture;
  };
  // What is compared with frames at the photos' places has their exposures.
  const PhotoGains gains = FrameGains(views, settings.render, all),
                   training_gains = FrameGains(views, settings.render, training_views);
  const WorkingViews as_shown = settings.render.keep_exposure ? views.AsTaken() : views;
  const auto photo_2d_as_shown = [&](int i) {
    Image picture = photo_2d(i);
    PutGain(gains.Of(i), &picture);
    return picture;
  };
  const ViewControls controls{
      &as_shown, !settings.object.On(), of_picture ? &style : nullptr,
      [&](int i) {  // held-out photos have no picture: NaN is left out
        if (std::ranges::find(training_views, i) != training_views.end())
          return photo_2d_as_shown(i);
        Image none = views.Photo(i);
        std::ranges::fill(none.pixels, std::nanf(""));
        return none;
      }};
  const FrameSource all_2d = renders_styled ? sequences[1].frames : FrameSource();
  if (settings.consistency.HasControls())
    Append(controls.Of(all, sequences[0].frames, all_2d, sequences.back().frames, same_camera),
           &sequences);
  std::optional<StoredField> field_2d;
  if (settings.consistency.HasControlField()) {
    field_2d = ControlField(context, views, stored, training_views, photo_2d,
                            parts.Next(kControlFieldSeconds));
    sequences.push_back(ControlFieldFrames(*field_2d, compared, gains));
  }
  // Fidelity is measured on the training views of the style, against the 2D method applied to
  // the rendered frames, or else to the photos.
  const FrameSource of_photos{static_cast<int>(training_views.size()),
                              [&](int k) { return photo_2d_as_shown(training_views[k]); }};
  FidelityTargets networks;
  if (of_picture) networks.style = &style;
  OpenNetworks(settings.consistency, &networks);
  FidelityTargets targets = networks;
  targets.views_2d = renders_styled ? frames("views_2d", training_views) : of_photos;
  const bool edited =
      std::filesystem::exists(workspace.Path("frames/" + std::string(kEditedFrames)));
  if (edited)
    targets.views_2d = WhereEdited(targets.views_2d, frames(kEditedFrames, training_views));
  targets.transmittance = frames("transmittance", training_views);
  targets.unstyled = frames("source", training_views);
  std::vector<Camera> training_cameras;
  for (const int i : training_views) training_cameras.push_back(cameras[i]);
  std::optional<StoredField> ceiling;
  if (settings.consistency.HasControls()) {
    ceiling = CeilingField(ReadStyledField(context->workspace->folder(), workspace.folder()),
                           training_cameras, UndoGains(targets.views_2d, training_gains),
                           settings.run.seed, parts.Next(kCeilingSeconds));
    sequences.push_back(ControlFieldFrames(*ceiling, compared, gains, kCeilingControl));
  }
  BeginHeatMaps(workspace);
  std::vector<HeatMapFile> heat_maps;
  ConsistencyReport consistency =
      Compare(workspace, sequences, compared[0],
              settings.consistency.mode == "geometry" ? GeometryOf(stored.field, compared)
                                                      : GeometrySource(),
              settings.consistency,
              parts.Next(PairWeight(settings, static_cast<int>(all.size()))), &heat_maps);

  std::vector<NamedFrameSource> measured;
  for (const char* name : {"source", "views_2d", "styled"})
    if (renders_styled || name != std::string("views_2d"))
      measured.push_back({name, frames(name, training_views)});
  if (settings.consistency.HasControls())
    Append(controls.Of(training_views, targets.unstyled, targets.views_2d,
                       measured.back().frames, true),
           &measured);
  if (field_2d)
    measured.push_back(ControlFieldFrames(*field_2d, training_cameras, training_gains));
  if (ceiling)
    measured.push_back(
        ControlFieldFrames(*ceiling, training_cameras, training_gains, kCeilingControl));
  std::vector<FidelityRow> fidelity = MeasureFidelities(
      measured, targets, parts.Next(n * kFrameSeconds * static_cast<double>(measured.size())));
  AddFilm(context, networks, CommonCamera(cameras), &parts, &consistency, &fidelity,
          &heat_maps);
  // Of an edit of single photos only these say what is wanted.
  const std::vector<Image> layers = LayersOf(settings.residual, views);
  std::vector<int> wanted = training_views;
  if (edited) {
    wanted = all;
    std::erase_if(wanted, [&](int i) { return layers[static_cast<size_t>(i)].empty(); });
  }
  const FrameSource wanted_photos{static_cast<int>(wanted.size()), [&](int k) {
                                    const int i = wanted[static_cast<size_t>(k)];
                                    Image photo = photo_2d(i);
                                    if (edited)
                                      photo = WithLayer(photo, layers[static_cast<size_t>(i)],
                                                        settings.style.strength);
                                    PutGain(gains.Of(i), &photo);
                                    return photo;
                                  }};
  const FidelityTargets photo_targets{
      wanted_photos, frames("transmittance", wanted), nullptr, {}, {}, /*only_psnr=*/true};
  const FidelityRow to_photos = MeasureFidelity({"styled", frames("styled", wanted)},
                                                photo_targets, parts.Next(n * kFrameSeconds));

  const Backend backend = ChooseBackend(settings.run.device, settings.run.reproducible);
  EvaluateReport report;
  report.flow = settings.consistency.flow;
  report.mask = settings.consistency.mode;
  report.warp = settings.consistency.warp;
  report.error_per = settings.consistency.error_per;
  report.protocol = ProtocolOf(settings.consistency);
  report.not_to_the_letter = SayIfPaper(settings, ProtocolValues(settings), context->console);
  if (!same_camera) report.comparison_note = ComparisonNote(compared[0]);
  if (edited) report.edit_seen = MeanOfPictures(frames(kEditedFrames, training_views));
  report.psnr_to_2d_photos_db = Metric(to_photos.psnr_to_2d_db);
  report.linear_map_psnr_to_2d_db =
      settings.object.On()
          ? Metric::Undefined("one map of the whole scene does not compare with an object's")
          : Metric(LinearMapPsnr(stored.field, training_cameras,
                                 frames("source", training_views), targets.views_2d,
                                 targets.transmittance, training_gains, backend,
                                 parts.Next(n * kLinearMapSeconds)));
  if (!settings.consistency.lpips.empty()) {
    const auto lpips = [&](const std::vector<int>& of) {
      return MeanOf(
          MeasureOnPhotos(context->Views(), of, stored, backend, networks.perceptual).lpips);
    };
    report.lpips_heldout = lpips(views.HeldOut());
    report.lpips_train = lpips(MeasuredTrainingViews(views));
  }
  if (!same_camera) context->console->Info(report.comparison_note);
  TableContext table;
  table.protocol = report.protocol;
  table.version = REGRADE_VERSION;
  const std::vector<MissingControl> missing =
      MissingControls(settings, renders_styled || of_picture, same_camera);
  for (const MissingControl& control : missing) {
    table.remarks.push_back(control.sequence + ": left out, " + control.why);
    context->console->Info(table.remarks.back());
  }
  context->console->DetailLines(FormatTables(consistency, fidelity, table));
  StageOutcome outcome;
  outcome.outputs = {kHeatMapFolder};
  EvaluationMetrics metrics = MetricsOf(consistency, fidelity, heat_maps);
  if (!missing.empty()) metrics.missing_controls = missing;
  PutMetrics(metrics, &outcome.metrics);
  PutMetrics(report, &outcome.metrics);
  return outcome;
}

}  // namespace

Stage EvaluateStage(RunContext* context) {
  Stage stage;
  stage.name = "evaluate";
  stage.inputs = JsonValue::Object{{"frames", context->ResultOf("render")},
                                   {"views_2d", context->ResultOf("style_2d")},
                                   {"style", StyleFiles(context->settings.style)},
                                   {"holdout", context->settings.run.holdout},
                                   {"options", OptionValues(context->settings.consistency)}};
  stage.work = [context](const ProgressFunction& progress) {
    return Evaluate(context, progress);
  };
  return stage;
}

}  // namespace regrade
