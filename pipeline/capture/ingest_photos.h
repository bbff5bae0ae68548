// Stages the photos of a folder: each is decoded once, checked, and written as an upright RGB
// PNG under a name of our own, which is what later stages read.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/base/options.h"
#include "kernels/base/progress.h"
#include "kernels/scene/capture.h"

namespace regrade {

struct IngestOptions {
  bool accept_damaged = false;
  int64_t max_megapixels = 128;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("accept-damaged", accept_damaged,
         {.help = "uses JPEG photos with lost parts instead of leaving them out"});
    bind("max-megapixels", max_megapixels,
         {.unit = "megapixels",
          .help = "leaves larger photos out; reading one needs 16 bytes a pixel",
          .min = 1,
          .max = 1000});
  }
};

struct IngestResult {
  std::vector<StagedPhoto> photos;    // in natural order of `file`
  std::vector<PhotoStatus> statuses;  // one for each file that is not hidden, same order
  std::vector<std::string> notices;   // sentences for the user, one for each kind of event
  int hidden = 0;                     // files and folders whose name begins with a dot
  // Changes when a used photo's name or pixels change, or their order.
  std::string fingerprint;
};

// Photos of `folder` and its subfolders, recognized by content, as `staging_folder`/00000.png,
// ... in natural order of names: with 16 bits a channel where the file has more than 8, else
// with 8. A photo with alpha is composited on white; its alpha is written as 00007.alpha.png.
// Files that are no photo, damaged, or the same picture (in 8 bits) as an earlier one are left
// out, with a status that says why. Staged files of an earlier call that are not of this one
// are deleted; those that already hold the right pixels are not written again. Three photos are
// in memory at a time. Throws Error(kInput) when there is no usable photo, Error(kScene) for 1
// or 2, Error(kResources) when a disk fails, Interrupted.
IngestResult IngestPhotos(const std::string& folder, const std::string& staging_folder,
                          const IngestOptions& options, const ProgressFunction& progress);

}  // namespace regrade
