// Stages the photos of a folder and frames of its films: each is decoded once, checked, and
// written as an upright RGB PNG under a name of our own, which is what later stages read.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "kernels/base/options.h"
#include "kernels/base/progress.h"
#include "kernels/scene/capture.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/input_files.h"

namespace regrade {

struct IngestOptions {
  bool accept_damaged = false;
  int64_t max_megapixels = 128;
  int video_frames = 0;
  // What follows has no flags.
  bool take_clips = true;  // films; they have no given poses
  // Leaves out repeated shots (repeated_shots.h): not where poses decide.
  bool one_a_shot = true;
  // See ListInputs.
  std::set<std::string> only;
  std::vector<std::string> not_photos;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("accept-damaged", accept_damaged,
         {.help = "uses JPEG photos with lost parts instead of leaving them out",
          .constant = true});
    bind("max-megapixels", max_megapixels,
         {.unit = "megapixels",
          .help = "leaves larger photos out; reading one needs 16 bytes a pixel",
          .min = 1,
          .max = 1000,
          .constant = true});
    bind("video-frames", video_frames,
         {.unit = "frames",
          .help = "frames to pick of all films together; 0 picks 40 to 120, by how far the "
                  "camera moves",
          .min = 0,
          .max = 10000});
  }
};

struct IngestResult {
  std::vector<StagedPhoto> photos;    // in natural order of `file`
  std::vector<PhotoStatus> statuses;  // one for each file that is not hidden, same order
  std::vector<std::string> notices;   // sentences for the user, one for each kind of event
  std::string summary;                // what was taken and left; empty if all are photos
  int hidden = 0;                     // files and folders whose name begins with a dot
  // Changes when a used photo's name or pixels change, or their order.
  std::string fingerprint;
};

// Photos of the folder `source` and its subfolders, or of the one film that it is, recognized
// by content, as `staging_folder`/00000.png, ... in natural order of names: with 16 bits a
// channel where the file has more than 8, else with 8. A photo with alpha is composited on
// white; its alpha is written as 00007.alpha.png. Of films, frames are picked (clip_frames.h);
// they count as photos of their own, "CLIP.mp4/003.250s.png". Files that are no photo
// (input_files.h), damaged, the same picture (in 8 bits) as an earlier one, less than a
// quarter as large as most (thumbnails), or repeated shots (repeated_shots.h) are left out,
// with a status that says why. Staged files of an earlier call that are not of this one are
// deleted; those that already hold the right pixels are not written again. Three photos are in
// memory at a time. Throws Error(kInput) when there is no usable photo, Error(kScene) for 1 or
// 2, Error(kResources) when a disk fails, Interrupted.
IngestResult IngestPhotos(const std::string& source, const std::string& staging_folder,
                          const IngestOptions& options, const ProgressFunction& progress);

// The files of a capture's photos; without films where poses are given.
InputFiles InputsOf(const CaptureSource& source);

// Before anything is decoded: how many photos there may be, and "24 files and 2 films (31.0 s),
// of which 40 to 120 frames are picked".
int64_t ExpectedPhotos(const InputFiles& inputs, const IngestOptions& options);
std::string PlannedInputs(const InputFiles& inputs, const IngestOptions& options);

}  // namespace regrade
