// Triangulates tracks with COLMAP for a capture whose poses came without points.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/scene/capture.h"
#include "pipeline/files/json_file.h"
#include "reconstruct/colmap/poses_from_photos.h"

namespace regrade {

// Fewer points than this mean wrong poses rather than a plain scene.
inline constexpr size_t kFewestTracks = 50;
// Likewise, on average: right poses have 4 to 10, those of other photos 2.3.
inline constexpr double kFewestObservationsOfAPoint = 2.7;

// False if poses came with points, for transparent photos, whose silhouettes give a better box
// (`effects`: --effects, which may override alpha), and with --tracks given. Reads silhouettes
// if every photo has one.
bool WantsTracks(const PoseOptions& options, const std::string& effects,
                 const Capture& capture);

struct PoseTracks {
  JsonValue metrics;        // null if not tried
  std::string note;         // a sentence for the user; empty likewise
  double misfit_scale = 1;  // photo pixels per pixel of the pictures that features came from
};

// Finds tracks (tracks_for_poses.h) and rewrites `capture` and the model in `sparse_folder`,
// which holds the poses. If that fails, or the points are implausible, both stay unchanged, and
// the note says why. Throws Interrupted, and Error(kResources) when the disk is full.
PoseTracks AddTracks(const PoseOptions& options, const std::string& effects,
                     const std::string& sparse_folder, const std::vector<StagedPhoto>& photos,
                     const std::string& work_folder, Capture* capture,
                     const ProgressFunction& progress);

}  // namespace regrade
