// Tracks for a capture whose poses came without: whether they are looked for, and what that
// took.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/scene/capture.h"
#include "pipeline/files/json_file.h"
#include "reconstruct/colmap/poses_from_photos.h"

namespace regrade {

// Fewer points than this say more against the poses than about the scene.
inline constexpr size_t kFewestTracks = 50;
// Likewise, on average: right poses have 4 to 10, those of other photos 2.3.
inline constexpr double kFewestObservationsOfAPoint = 2.7;

// Would they be looked for? Not where poses came with points, not for transparent photos, whose
// outlines say more (`effects`: --effects, which may say of alpha), and not against --tracks
// given. Reads outlines, where every photo has one.
bool WantsTracks(const PoseOptions& options, const std::string& effects,
                 const Capture& capture);

struct PoseTracks {
  JsonValue metrics;        // null where none were looked for
  std::string note;         // a sentence for a person; empty likewise
  double misfit_scale = 1;  // pixels of the photos that are one of those features were found in
};

// Finds them (tracks_for_poses.h) and writes the model in `sparse_folder`, which holds the
// poses, and `capture` anew; where that fails, or finds points that are not to be believed,
// both stay as they are, and the note says why. Throws Interrupted, and Error(kResources) when
// the disk is full.
PoseTracks AddTracks(const PoseOptions& options, const std::string& effects,
                     const std::string& sparse_folder, const std::vector<StagedPhoto>& photos,
                     const std::string& work_folder, Capture* capture,
                     const ProgressFunction& progress);

}  // namespace regrade
