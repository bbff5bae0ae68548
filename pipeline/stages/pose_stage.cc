// Stage "pose": a folder of photos becomes poses/, a capture with a camera for each photo that
// found its place.
#include <omp.h>

#include <filesystem>

#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/photo_masks.h"
#include "pipeline/capture/pose_profile.h"
#include "pipeline/capture/pose_tracks.h"
#include "pipeline/capture/scene_profile.h"
#include "pipeline/files/folder_listing.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/run/plan.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/stages.h"
#include "pipeline/workspace/metrics_json.h"

namespace regrade {
namespace {

// Which files, with which contents: what F40's difference is listed from.
JsonValue PhotoSet(const CaptureSource& source) {
  JsonValue files = JsonValue::Object();
  for (const ListedFile& file : ListFolder(source.photos).files)
    files[file.name] = file.problem.empty() ? HashFile(file.path) : file.problem;
  return files;
}

// Seconds on two cores, roughly: photos take what their bytes take to read, and their number to
// place.
struct StageShares {
  double ingest = 1, poses = 0, tracks = 0, refinement = 0.5;
};

StageShares EstimateObjectWeights(const CaptureSource& source) {
  double bytes = 0, photos = 0;
  for (const ListedFile& file : ListFolder(source.photos).files) {
    std::error_code none;
    const auto size = std::filesystem::file_size(file.path, none);
    if (!none) bytes += static_cast<double>(size), ++photos;
  }
  const double ingest = 0.5e-6 * bytes + 0.1;
  if (source.kind == CaptureKind::kPhotos)
    return {ingest, 0.75 * kPoseSecondsPerPhoto * photos, 0, 0};
  // Whether tracks are looked for is known later.
  if (source.kind == CaptureKind::kTransforms || source.kind == CaptureKind::kLlff)
    return {ingest, 0, kTrackSecondsPerPhoto * photos, 0.1 * photos};
  return {ingest, 0, 0, 0.1 * photos};
}

// What a dry run says of tracks, which may be looked for.
std::string PlannedTracks(const RunSettings& settings, const CaptureSource& source,
                          int64_t photos) {
  const bool may = source.kind == CaptureKind::kTransforms || source.kind == CaptureKind::kLlff;
  if (!may || settings.pose.tracks != "auto") return "";
  return "; points by COLMAP, unless photos are transparent: " +
         PlanText(PlanTracks(photos, omp_get_max_threads()));
}

// The folder of masks: that of the options, or what another run of ours has staged.
std::string MasksOf(const RunContext& context, const CaptureSource& source) {
  const std::string& given = context.settings.pose.photo_masks;
  if (!given.empty() || source.kind != CaptureKind::kPosed) return given;
  const std::filesystem::path staged =
      std::filesystem::path(source.photos).parent_path() / "masks";
  return std::filesystem::is_directory(staged) ? staged.string() : "";
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

  const StageShares shares = EstimateObjectWeights(source);
  ProgressParts parts(progress,
                      shares.ingest + shares.poses + shares.tracks + shares.refinement);
  const IngestResult ingest =
      IngestPhotos(source.photos, photo_folder, settings.ingest, parts.Next(shares.ingest));
  for (const std::string& notice : ingest.notices) context->console->Info(notice);

  StageOutcome outcome;
  PoseStageReport metrics;
  Capture capture;
  PoseOptions options = settings.pose;
  options.threads = settings.program.threads;
  const std::string mask_folder = workspace.Path("poses/masks");
  std::filesystem::remove_all(mask_folder);  // of an earlier run
  if (const std::string folder = MasksOf(*context, source); !folder.empty()) {
    options.mask_folder = mask_folder;
    const int masks = StagePhotoMasks(folder, ingest.photos, options.mask_folder);
    context->console->Info("what " + std::to_string(masks) +
                           " masks blacken is neither matched nor fitted");
    metrics.photo_masks = masks;
  }
  if (source.kind == CaptureKind::kPhotos) {
    PoseReport report;
    capture = PosesFromPhotos(ingest.photos, ingest.statuses, options,
                              workspace.Path(".regrade/work/pose"), sparse_folder,
                              parts.Next(shares.poses), &report);
    for (const std::string& note : report.notes) context->console->Info(note);
    metrics.colmap = report.colmap_version;
    metrics.strategy = report.strategy;
    metrics.lens = report.lens;
  } else {
    std::vector<std::string> notes;
    capture = ImportPoses(source, ingest.photos, ingest.statuses, sparse_folder, &notes);
    for (const std::string& note : notes) context->console->Info(note);
    metrics.given_poses = source.poses;
  }
  PoseTracks tracks;
  if (source.kind != CaptureKind::kPhotos)
    tracks = AddTracks(options, settings.run.effects, sparse_folder, ingest.photos,
                       workspace.Path(".regrade/work/pose/tracks"), &capture,
                       parts.Next(shares.tracks));
  if (!tracks.note.empty()) context->console->Info(tracks.note);
  if (!tracks.metrics.IsNull()) outcome.metrics["tracks"] = tracks.metrics;
  const PoseProfile profile =
      ProfilePoses(source.kind, settings.pose, settings.run.effects, sparse_folder,
                   ingest.photos, tracks.misfit_scale, &capture, parts.Next(shares.refinement));
  context->console->Info(EffectLine(profile.effect));
  outcome.metrics["effects"] = EffectsRecord({profile.effect});
  if (!profile.metrics.IsNull()) outcome.metrics["pose_refinement"] = profile.metrics;
  WriteCaptureIndex(workspace.Path("poses"), capture, ingest.photos);
  metrics.registered = static_cast<int>(capture.views.size());
  metrics.points = static_cast<int64_t>(capture.points.size());
  metrics.reprojection_px = capture.reprojection_px;
  metrics.models_found = capture.models_found;
  PutMetrics(metrics, &outcome.metrics);
  outcome.outputs = {"poses"};
  context->console->Info("placed " + std::to_string(capture.views.size()) + " of " +
                         std::to_string(ingest.photos.size()) + " photos, " +
                         std::to_string(capture.points.size()) + " points");
  return outcome;
}

}  // namespace

Stage PoseStage(RunContext* context) {
  const CaptureSource source = DetectCapture(context->source);
  Stage stage;
  stage.name = "pose";
  stage.inputs = JsonValue::Object{
      {"photos", PhotoSet(source)},
      {"options", OptionValues(context->settings.ingest, context->settings.pose)}};
  if (source.kind == CaptureKind::kTransforms || source.kind == CaptureKind::kLlff)
    stage.inputs["poses"] = HashFile(source.poses);
  if (source.kind == CaptureKind::kColmap || source.kind == CaptureKind::kPosed)
    for (const char* part : {"cameras.bin", "images.bin", "points3D.bin", "cameras.txt",
                             "images.txt", "points3D.txt"})
      if (std::filesystem::is_regular_file(source.poses + "/" + part))
        stage.inputs["poses"][part] = HashFile(source.poses + "/" + part);
  if (source.kind == CaptureKind::kPosed)
    stage.inputs["poses"]["nearest_depth"] = NearestDepthOf(source);
  const auto wishes = ParseEffects(context->settings.run.effects);
  if (const auto wish = wishes.find(kPoseRefinement); wish != wishes.end())
    stage.inputs[kPoseRefinement] = wish->second;
  if (const std::string folder = MasksOf(*context, source); !folder.empty())
    stage.inputs["photo_masks"] = PhotoMaskFiles(folder);
  stage.refuse_changes = true;
  const int64_t photos = static_cast<int64_t>(stage.inputs.At("photos").AsObject().size());
  stage.plan =
      std::to_string(photos) + " files in " + source.photos +
      (source.kind == CaptureKind::kPhotos
           ? ", poses by COLMAP: " + PlanText(PlanPoses(photos, omp_get_max_threads()))
           : ", poses from " + source.poses + PlannedTracks(context->settings, source, photos));
  stage.work = [context, source](const ProgressFunction& progress) {
    return FindPoses(context, source, progress);
  };
  return stage;
}

}  // namespace regrade
