#include "pipeline/capture/pose_tracks.h"

#include <algorithm>

#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "pipeline/capture/scene_profile.h"
#include "pipeline/program/cpu_time.h"
#include "reconstruct/colmap/tracks_for_poses.h"

namespace regrade {
namespace {

constexpr char kWithoutPoints[] =
    " Without points, exposure and pose errors are not measured, and the box is estimated from "
    "the cameras";

std::string Summary(const FoundTracks& found, double seconds, double cpu_seconds) {
  return Format(
      "the poses are without points: COLMAP %s triangulated %zu with %lld observations, "
      "median reprojection error %.2f px, in %.0f s (%.0f s of CPU); --tracks given "
      "skips this",
      found.colmap_version.c_str(), found.model.points.size(),
      static_cast<long long>(found.observations), found.median_px, seconds, cpu_seconds);
}

// Wrong poses give points, too: a match between two photos may fit by chance, but a third
// observation hardly ever does.
bool Plausible(const FoundTracks& found) {
  const double points = static_cast<double>(found.model.points.size());
  return found.model.points.size() >= kFewestTracks &&
         static_cast<double>(found.observations) >= kFewestObservationsOfAPoint * points;
}

std::string DoubtText(const FoundTracks& found) {
  return Format(
             "with the given poses COLMAP triangulated %zu points, %.1f observations of each "
             "on average: too little texture, or poses of other photos.",
             found.model.points.size(),
             found.model.points.empty() ? 0.0
                                        : static_cast<double>(found.observations) /
                                              static_cast<double>(found.model.points.size())) +
         kWithoutPoints;
}

}  // namespace

bool WantsTracks(const PoseOptions& options, const std::string& effects,
                 const Capture& capture) {
  if (options.tracks != "auto" || !capture.points.empty()) return false;
  const auto overrides = ParseEffects(effects);
  const auto alpha = overrides.find("alpha");
  return alpha == overrides.end() ? !ShowsThroughPhotos(capture) : !alpha->second;
}

PoseTracks AddTracks(const PoseOptions& options, const std::string& effects,
                     const std::string& sparse_folder, const std::vector<StagedPhoto>& photos,
                     const std::string& work_folder, Capture* capture,
                     const ProgressFunction& progress) {
  PoseTracks result;
  if (!WantsTracks(options, effects, *capture)) return result;
  const double began = ClockSeconds();
  const double cpu_before = CpuSeconds();
  FoundTracks found;
  try {
    found =
        TracksForPoses(ReadColmapModel(sparse_folder), photos, options, work_folder, progress);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kExternalProgram) throw;
    result.note = std::string("COLMAP found no tracks for the poses.") + kWithoutPoints + ": " +
                  error.what_failed();
    result.metrics = JsonValue::Object{{"points", 0}, {"failed", error.what_failed()}};
    return result;
  }
  const double seconds = ClockSeconds() - began;
  const double cpu_seconds = CpuSeconds() - cpu_before;
  result.metrics = JsonValue::Object{{"points", std::ssize(found.model.points)},
                                     {"observations", found.observations},
                                     {"median_px", found.median_px},
                                     {"pairs", found.pairs},
                                     {"colmap", found.colmap_version},
                                     {"seconds", seconds},
                                     {"cpu_seconds", cpu_seconds}};
  if (!Plausible(found)) {
    result.note = DoubtText(found);
    return result;
  }
  WriteColmapModel(found.model, sparse_folder);
  Capture tracked = CaptureFromModel(found.model, photos, PhotoNames::kStaged);
  capture->points = std::move(tracked.points);
  capture->reprojection_px = tracked.reprojection_px;
  int side = 0;
  for (const StagedPhoto& photo : photos) side = std::max({side, photo.width, photo.height});
  result.misfit_scale = std::max(1.0, static_cast<double>(side) / options.image_size);
  result.note = Summary(found, seconds, cpu_seconds);
  return result;
}

}  // namespace regrade
