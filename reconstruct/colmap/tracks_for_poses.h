// Finds tracks for given poses without points: COLMAP extracts, matches and triangulates.
//
// Tracks are needed to measure exposure, pose errors and the scene's extent. The expensive half
// of COLMAP, the mapper, is not run.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/poses_from_photos.h"

namespace regrade {

struct FoundTracks {
  ColmapModel model;  // the given poses and lenses (bitwise) with keypoints and points
  int64_t observations = 0;
  double median_px = 0;  // reprojection error, pixels of the photos
  int pairs = 0;         // of photos that were matched
  std::string colmap_version;
};

// `posed` has images with the staged names of `photos`; images without a photo and photos
// without an image are ignored. Replaces its points. `work_folder` receives database, logs and
// models.
//
// Throws Error: kExternalProgram if COLMAP is missing or fails, kResources if the disk is full;
// Interrupted on kStop.
FoundTracks TracksForPoses(const ColmapModel& posed, const std::vector<StagedPhoto>& photos,
                           const PoseOptions& options, const std::string& work_folder,
                           const ProgressFunction& progress = {});

}  // namespace regrade
