// Photos in, a Capture out: COLMAP run as a program, climbing a strategies of recipes until one
// places the photos, its model checked, its camera fitted once more.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/scene/capture.h"

namespace regrade {

struct PoseOptions {
  std::string colmap = "colmap";
  int image_size = 1000;
  int all_pairs_up_to = 30;
  double min_registered = 0.5;
  int min_photos = 5;
  double time_limit_min = 0;
  double quiet_limit_min = 15;
  bool free_focal = false;
  std::string tracks = "auto";
  std::string photo_masks;
  std::string mask_folder;  // as COLMAP wants them (photo_masks.h); empty: none. No flag.
  int threads = 0;          // 0: all; from --threads, no flag of its own

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("colmap", colmap, {.help = "the COLMAP program: a name on PATH, or a path"});
    bind("pose-image-size", image_size,
         {.unit = "pixels",
          .help = "longer side at which features are found; 2000 takes about 4 times as long "
                  "and hardly moves the poses",
          .min = 200,
          .max = 20000});
    bind("pose-all-pairs-up-to", all_pairs_up_to,
         {.unit = "photos",
          .help = "match every photo with every other up to this many photos; above, each with "
                  "its neighbours in the order of names",
          .min = 2,
          .max = 10000});
    bind("pose-min-registered", min_registered,
         {.help = "least share of the photos that must find their place", .min = 0, .max = 1});
    bind("pose-min-photos", min_photos,
         {.unit = "photos",
          .help = "least number of photos that must find their place",
          .min = 2,
          .max = 1000});
    bind("pose-time-limit", time_limit_min,
         {.unit = "minutes",
          .help = "for finding the poses; 0 allows what the number of photos asks for",
          .min = 0,
          .max = 1e6});
    bind("pose-quiet-limit", quiet_limit_min,
         {.unit = "minutes",
          .help =
              "COLMAP is taken for hung when it prints nothing for so long; 0 waits for ever",
          .min = 0,
          .max = 1e6});
    bind("pose-free-focal", free_focal,
         {.help = "where poses that came with the photos are refined, so are focal lengths, by "
                  "one factor a camera"});
    bind("tracks", tracks,
         {.help =
              "of poses that came without points: auto has COLMAP find what the photos share, "
              "half a second to a second a photo, so that exposure, the poses themselves, "
              "the scene's reach and its surroundings can be measured; given goes without. "
              "Transparent photos are never searched",
          .choices = "auto|given"});
    bind("photo-masks", photo_masks,
         {.help = "folder of pictures by the photos' names, black on people, cars and whatever "
                  "else moved, white elsewhere: what is black is neither matched nor fitted"});
  }
};

// What there is to say besides the Capture itself.
struct PoseReport {
  std::string colmap_version;  // "3.8"
  std::string recipe;          // the attempt of the strategies that won
  int attempts_made = 0;
  std::string lens;                // what the last adjustment chose
  std::vector<std::string> notes;  // sentences for the user
};

// `photos`: staged PNGs, all in one folder; only these are used, whatever else lies there.
// `ingest_statuses`: what became of the files before, copied in front of ours (files that are
// named in `photos` get their verdict here). `work_folder` is ours to fill (database, logs) and
// may be removed afterwards. The chosen model's three .bin files are copied to
// `sparse_output_folder`.
//
// Throws Error: kScene when the photos do not give poses that can be trusted, kExternalProgram
// when COLMAP is missing or fails, kResources when the disk is full; Interrupted on kStop.
Capture PosesFromPhotos(const std::vector<StagedPhoto>& photos,
                        const std::vector<PhotoStatus>& ingest_statuses,
                        const PoseOptions& options, const std::string& work_folder,
                        const std::string& sparse_output_folder,
                        const ProgressFunction& progress = {}, PoseReport* report = nullptr);

}  // namespace regrade
