// Stage "pose": a folder of photos becomes poses/, a capture with a camera for each registered
// photo.
#include <omp.h>

#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/colmap_photos.h"
#include "pipeline/capture/ingest_photos.h"
#include "pipeline/capture/measured_depths.h"
#include "pipeline/capture/photo_gains.h"
#include "pipeline/capture/photo_masks.h"
#include "pipeline/capture/pose_profile.h"
#include "pipeline/capture/pose_tracks.h"
#include "pipeline/capture/scene_profile.h"
#include "pipeline/files/text.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/run/plan.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/scene_source.h"
#include "pipeline/stages/stages.h"
#include "pipeline/workspace/metrics_json.h"
#include "reconstruct/colmap/photo_statuses.h"
#include "reconstruct/scene/given_poses.h"

namespace regrade {
namespace {

// A film's compressed bytes take this many times as long as a photo's, and it gives about so
// many frames.
constexpr double kFilmBytes = 3, kFramesOfFilm = 60;
constexpr char kColmapPhotos[] = ".regrade/work/pose_photos";

// Names and hashes of the files (F40).
JsonValue PhotoSet(const CaptureSource& source) {
  JsonValue files = JsonValue::Object();
  for (const InputFile& input : InputsOf(source).files)
    files[input.file.name] =
        input.file.problem.empty() ? HashFile(input.file.path) : input.file.problem;
  return files;
}

// Rough seconds on two cores: ingest grows with the bytes, poses with the number of photos.
struct StageSeconds {
  double ingest = 1, poses = 0, tracks = 0, refinement = 0.5;
};

StageSeconds EstimateSeconds(const CaptureSource& source) {
  double bytes = 0, photos = 0;
  for (const InputFile& input : InputsOf(source).files) {
    std::error_code none;
    const auto size = std::filesystem::file_size(input.file.path, none);
    if (none || input.kind == InputKind::kLeft) continue;
    const bool clip = input.kind == InputKind::kClip;
    bytes += static_cast<double>(size) * (clip ? kFilmBytes : 1);
    photos += clip ? kFramesOfFilm : 1;
  }
  const double ingest = 0.5e-6 * bytes + 0.1;
  if (source.kind == CaptureKind::kPhotos)
    return {ingest, 0.75 * kPoseSecondsPerPhoto * photos, 0, 0};
  // Whether tracks are needed is known later.
  if (LacksPoints(source.kind))
    return {ingest, 0, kTrackSecondsPerPhoto * photos, 0.1 * photos};
  return {ingest, 0, 0, 0.1 * photos};
}

// The clause of a dry run about tracks, which may be needed.
std::string PlannedTracks(const RunSettings& settings, const CaptureSource& source) {
  if (!LacksPoints(source.kind) || settings.pose.tracks != "auto") return "";
  return "; points by COLMAP, unless photos are transparent";
}

// The folder of masks: that of the options, or of the run that the poses come from.
std::string MasksOf(const RunContext& context, const CaptureSource& source) {
  const std::string& given = context.settings.pose.photo_masks;
  if (!given.empty() || source.kind != CaptureKind::kPosed) return given;
  const std::filesystem::path staged =
      std::filesystem::path(source.photos).parent_path() / "masks";
  return std::filesystem::is_directory(staged) ? staged.string() : "";
}

// The files that the poses name, for the photos that were taken; or empty texts.
std::vector<std::string> ByPhoto(const std::map<std::string, std::string>& by_photo,
                                 const std::vector<StagedPhoto>& photos) {
  std::vector<std::string> files;
  for (const StagedPhoto& photo : photos) {
    const auto found = by_photo.find(photo.file);
    files.push_back(found == by_photo.end() ? "" : found->second);
  }
  return files;
}

StageOutcome FindPoses(RunContext* context, const CaptureSource& source,
                       const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->workspace;
  const std::string photo_folder = workspace.Path("poses/photos");
  const std::string sparse_folder = workspace.Path("poses/sparse");
  workspace.NewPath("poses/photos/x");
  workspace.NewPath("poses/sparse/x");
  workspace.NewPath(".regrade/work/pose/x");

  const StageSeconds seconds = EstimateSeconds(source);
  ProgressParts parts(progress,
                      seconds.ingest + seconds.poses + seconds.tracks + seconds.refinement);
  IngestOptions ingest_options = settings.ingest;
  ingest_options.take_clips = source.kind == CaptureKind::kPhotos;
  ingest_options.only = source.only;
  ingest_options.not_photos = source.not_photos;
  ingest_options.one_a_shot = source.kind == CaptureKind::kPhotos;
  IngestResult ingest =
      IngestPhotos(source.photos, photo_folder, ingest_options, parts.Next(seconds.ingest));
  std::vector<std::string> said = source.notes;
  if (!ingest.summary.empty()) said.push_back(ingest.summary);
  said.insert(said.end(), ingest.notices.begin(), ingest.notices.end());
  for (const std::string& notice : said) context->console->Info(notice);

  // By the names that photos have before the poses give them others.
  const std::vector<std::string> depth_files = ByPhoto(source.depths, ingest.photos);

  StageOutcome outcome;
  PoseStageReport metrics;
  Capture capture;
  PoseOptions options = settings.pose;
  options.threads = settings.program.threads;
  if (source.kind != CaptureKind::kPhotos) {
    std::vector<std::string> notes;
    capture = ImportPoses(source, &ingest.photos, ingest.statuses, sparse_folder, &notes);
    for (const std::string& note : notes) context->console->Info(note);
    said.insert(said.end(), notes.begin(), notes.end());
    metrics.given_poses = source.poses;
    // Whether all photos of a small capture are enough is up to the fit.
    PoseOptions minima = options;
    minima.min_photos = std::min(minima.min_photos, static_cast<int>(ingest.photos.size()));
    // A run has already held its own poses to them.
    if (source.kind != CaptureKind::kPosed)
      RequirePoses(capture, ingest.photos, minima, source.poses);
    RequireSoundPoses(capture, source.poses);
  }
  metrics.notices = said;
  const std::vector<StagedPhoto> colmap_photos =
      PhotosForColmap(ingest.photos, workspace.Path(kColmapPhotos));
  const std::string mask_folder = workspace.Path("poses/masks");
  std::filesystem::remove_all(mask_folder);  // of an earlier run
  std::filesystem::remove(workspace.Path("poses") + "/" + kExposureFile);
  const std::string masks_of_photos = MasksOf(*context, source);
  if (!masks_of_photos.empty() || !source.masks.empty()) {
    options.mask_folder = mask_folder;
    const int masks =
        masks_of_photos.empty()
            ? StageMasks(ByPhoto(source.masks, ingest.photos), ingest.photos, mask_folder)
            : StagePhotoMasks(masks_of_photos, ingest.photos, mask_folder);
    context->console->Info(Counted(masks, "mask") +
                           ": what is black there is neither matched nor fitted");
    metrics.photo_masks = masks;
  }
  std::vector<std::string> depth_notes;
  StageDepths(depth_files, ingest.photos, source.depth_unit, workspace.Path("poses/depths"),
              &depth_notes);
  for (const std::string& note : depth_notes) context->console->Info(note);
  metrics.notices.insert(metrics.notices.end(), depth_notes.begin(), depth_notes.end());
  if (source.kind == CaptureKind::kPhotos) {
    PoseReport report;
    const auto say_notes = [&] {
      for (const std::string& note : report.notes) context->console->Info(note);
    };
    try {
      capture = PosesFromPhotos(colmap_photos, ingest.statuses, options,
                                workspace.Path(".regrade/work/pose"), sparse_folder,
                                parts.Next(seconds.poses), &report);
    } catch (const Error&) {
      say_notes();
      throw;
    }
    say_notes();
    metrics.colmap = report.colmap_version;
    metrics.strategy = report.strategy;
    metrics.attempts = report.attempts;
    metrics.notices.insert(metrics.notices.end(), report.notes.begin(), report.notes.end());
    metrics.lens = report.lens;
  }
  PoseTracks tracks;
  const SceneSource& given = SourceOf(*context);
  if (given.has_points)
    given.add_points(*context, sparse_folder, source.poses, &capture);
  else if (source.kind != CaptureKind::kPhotos)
    tracks = AddTracks(options, settings.run.effects, sparse_folder, colmap_photos,
                       workspace.Path(".regrade/work/pose/tracks"), &capture,
                       parts.Next(seconds.tracks));
  if (!tracks.note.empty()) context->console->Info(tracks.note);
  if (!tracks.metrics.IsNull()) outcome.metrics["tracks"] = tracks.metrics;
  for (CaptureView& view : capture.views) view.path = photo_folder + "/" + view.name;
  const PoseProfile profile = ProfilePoses(
      source.kind, settings.pose, settings.run.effects + given.pose_effects, sparse_folder,
      ingest.photos, tracks.misfit_scale, &capture, parts.Next(seconds.refinement));
  context->console->Detail(EffectLine(profile.effect));
  outcome.metrics["effects"] = EffectsRecord({profile.effect});
  if (!profile.metrics.IsNull()) outcome.metrics["pose_refinement"] = profile.metrics;
  WriteCaptureIndex(workspace.Path("poses"), capture, ingest.photos);
  std::filesystem::remove_all(workspace.Path(kColmapPhotos));
  metrics.registered = static_cast<int>(capture.views.size());
  metrics.points = std::ssize(capture.points);
  metrics.reprojection_px = capture.points.empty() ? Metric::Undefined("there are no points")
                                                   : Metric(capture.reprojection_px);
  metrics.models_found = capture.models_found;
  PutMetrics(metrics, &outcome.metrics);
  outcome.outputs = {"poses"};
  context->console->Info(Concat("found the place of ", capture.views.size(), " of ",
                                Counted(std::ssize(ingest.photos), "photo"), ", and ",
                                Counted(std::ssize(capture.points), "point"), " of the scene"));
  return outcome;
}

}  // namespace

Stage PoseStage(RunContext* context) {
  const SceneSource& given = SourceOf(*context);
  if (std::optional<Stage> own = given.pose(context)) return std::move(*own);
  const CaptureSource source = context->Source();
  Stage stage;
  stage.name = "pose";
  stage.inputs = JsonValue::Object{
      {"photos", PhotoSet(source)},
      {"options", OptionValues(context->settings.ingest, context->settings.pose)}};
  if (source.kind == CaptureKind::kNsvf || source.kind == CaptureKind::kPolycam)
    stage.inputs["poses"] = HashFolder(source.poses);
  else if (LacksPoints(source.kind))
    stage.inputs["poses"] = HashFile(source.poses);
  for (const auto& [key, path] :
       {std::pair{"test_poses", source.test_poses}, std::pair{"intrinsics", source.intrinsics},
        std::pair{"box", source.box}})
    if (!path.empty()) stage.inputs[key] = HashFile(path);
  if (source.kind == CaptureKind::kColmap || source.kind == CaptureKind::kPosed)
    for (const char* part : {"cameras.bin", "images.bin", "points3D.bin", "cameras.txt",
                             "images.txt", "points3D.txt"})
      if (std::filesystem::is_regular_file(source.poses + "/" + part))
        stage.inputs["poses"][part] = HashFile(source.poses + "/" + part);
  if (source.kind == CaptureKind::kPosed) {
    const JsonValue known = KnownBesideModel(source);
    for (const auto& [key, value] : known.AsObject()) stage.inputs["poses"][key] = value;
  }
  const auto overrides = ParseEffects(context->settings.run.effects);
  if (const auto refine = overrides.find(kPoseRefinement); refine != overrides.end())
    stage.inputs[kPoseRefinement] = refine->second;
  if (const std::string folder = MasksOf(*context, source); !folder.empty())
    stage.inputs["photo_masks"] = HashFolder(folder);
  else
    for (const auto& [photo, mask] : source.masks)
      stage.inputs["photo_masks"][photo] = HashFile(mask);
  for (const auto& [photo, map] : source.depths) stage.inputs["depths"][photo] = HashFile(map);
  if (!source.depths.empty()) stage.inputs["depth_unit"] = source.depth_unit;
  if (const JsonValue splats = given.hash(*context); !splats.IsNull())
    stage.inputs["splats"] = splats;
  stage.refuse_changes = true;
  const InputFiles inputs = InputsOf(source);
  stage.plan =
      Concat(PlannedInputs(inputs, context->settings.ingest), " in ", source.photos,
             (source.kind == CaptureKind::kPhotos
                  ? ", poses by COLMAP"
                  : ", poses from " + source.poses + PlannedTracks(context->settings, source)));
  stage.work = [context, source](const ProgressFunction& progress) {
    return FindPoses(context, source, progress);
  };
  return stage;
}

}  // namespace regrade
