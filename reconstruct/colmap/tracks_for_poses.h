// Tracks for poses that came without any: what the photos see in common, found and matched by
// COLMAP, and put where the poses say.
//
// Without them nothing can be measured of exposure, of the poses themselves, or of how far the
// scene reaches. The costly half of COLMAP, finding poses, is not run.
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
  ColmapModel model;  // as given, poses and lenses to the bit, with keypoints and points
  int64_t observations = 0;
  double median_px = 0;  // their distance from their points, pixels of the photos
  int pairs = 0;         // of photos that were compared
  std::string colmap_version;
};

// `posed` has images under the staged names of `photos`; images that have no photo, and photos
// without an image, take no part. Points that it has are not looked at, and replaced.
// `work_folder` is ours to fill.
//
// Throws Error: kExternalProgram when COLMAP is missing or fails, kResources when the disk is
// full; Interrupted on kStop.
FoundTracks TracksForPoses(const ColmapModel& posed, const std::vector<StagedPhoto>& photos,
                           const PoseOptions& options, const std::string& work_folder,
                           const ProgressFunction& progress = {});

}  // namespace regrade
