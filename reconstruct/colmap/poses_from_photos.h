// Finds camera poses of photos: runs COLMAP with one strategy after the other until enough
// photos are registered, checks its model, and refines the intrinsics.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/scene/capture.h"

namespace regrade {

struct PoseOptions {
  std::string colmap = "colmap";
  std::string colmap_gpu = "auto";
  int image_size = 1000;
  int all_pairs_up_to = 30;
  double min_registered = 0.5;
  int min_photos = 5;
  double time_limit_min = 0;
  double quiet_limit_min = 15;
  bool free_focal = false;
  std::string tracks = "auto";
  std::string photo_masks;
  std::string mask_folder;  // in COLMAP's format (photo_masks.h); empty: none. Has no flag.
  int threads = 0;          // 0: all; set by --threads

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("colmap", colmap,
         {.help = "the COLMAP program: a name on PATH, or a path", .constant = true});
    bind("colmap-gpu", colmap_gpu,
         {.help = "auto finds and matches features on a GPU where this COLMAP was built with "
                  "CUDA, and goes on with the CPU if that fails",
          .choices = "auto|on|off",
          .constant = true});
    bind("pose-image-size", image_size,
         {.unit = "pixels",
          .help = "longer side for feature extraction; 2000 takes about 4 times as long and "
                  "hardly changes the poses",
          .min = 200,
          .max = 20000,
          .constant = true});
    bind(
        "pose-all-pairs-up-to", all_pairs_up_to,
        {.unit = "photos",
         .help = "match all pairs of up to this many photos; with more photos, match each with "
                 "its neighbours in the order of names, above 150 also by GPS or likeness",
         .min = 2,
         .max = 10000,
         .constant = true});
    bind("pose-min-registered", min_registered,
         {.help = "least fraction of the photos that must be registered",
          .min = 0,
          .max = 1,
          .constant = true});
    bind("pose-min-photos", min_photos,
         {.unit = "photos",
          .help = "least number of photos that must be registered",
          .min = 2,
          .max = 1000,
          .constant = true});
    bind("pose-time-limit", time_limit_min,
         {.unit = "minutes",
          .help = "time limit for finding poses; 0 sets it by the number of photos",
          .min = 0,
          .max = 1e6,
          .constant = true});
    bind("pose-quiet-limit", quiet_limit_min,
         {.unit = "minutes",
          .help = "stop COLMAP if it prints nothing for this long; 0 has no limit",
          .min = 0,
          .max = 1e6,
          .constant = true});
    bind("pose-free-focal", free_focal,
         {.help = "also refine focal lengths, by one factor per camera, where given poses are "
                  "refined",
          .constant = true});
    bind("tracks", tracks,
         {.help =
              "tracks for given poses without points: auto finds them with COLMAP (0.5 to 1 s "
              "per photo) to measure exposure, pose errors, the scene's extent and its "
              "surroundings; given uses none. Transparent photos get no tracks",
          .choices = "auto|given"});
    bind("photo-masks", photo_masks,
         {.help = "folder of masks named like the photos: black pixels (people, cars, anything "
                  "that moved) are neither matched nor fitted"});
  }
};

// Details of the pose computation.
struct PoseReport {
  std::string colmap_version;         // "3.8"
  std::string strategy;               // of the attempt that was used
  std::vector<std::string> attempts;  // each COLMAP run: "quick, one focal length: no model"
  std::string lens;                   // chosen by the last adjustment
  std::vector<std::string> notes;     // sentences for the user
};

// `photos`: staged PNGs in one folder, which may contain other files. `ingest_statuses`:
// statuses from ingest, which come first in the result; those of `photos` are updated.
// `work_folder` receives database and logs, and may be removed afterwards. Copies the chosen
// model's three .bin files to `sparse_output_folder`.
//
// Throws Error: kScene if the photos give no reliable poses, kExternalProgram if COLMAP is
// missing or fails, kResources if the disk is full; Interrupted on kStop.
Capture PosesFromPhotos(const std::vector<StagedPhoto>& photos,
                        const std::vector<PhotoStatus>& ingest_statuses,
                        const PoseOptions& options, const std::string& work_folder,
                        const std::string& sparse_output_folder,
                        const ProgressFunction& progress = {}, PoseReport* report = nullptr);

}  // namespace regrade
