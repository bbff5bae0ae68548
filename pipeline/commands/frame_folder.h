// A folder of frames that any program may have written, looked through before work begins.
#pragma once

#include <string>
#include <vector>

#include "evaluate/frame_source.h"
#include "kernels/base/progress.h"

namespace regrade {

struct FrameFolder {
  std::string folder;
  std::vector<std::string> paths;  // in natural order of names
  std::vector<std::string> names;  // relative to the folder

  FrameSource Source() const;
};

// Lists the folder and decodes each frame once, so that a bad one is told now and not after an
// hour: a damaged or unreadable file, frames of different sizes, a number that is missing from
// names that otherwise count evenly (the pairs across the hole would be further apart than
// their gap says), a number that two files share. Names without a common beginning and a number
// are not counted. Reports progress by frames.
//
// Errors: kInput, with the file.
FrameFolder OpenFrameFolder(const std::string& folder, const ProgressFunction& progress = {});

// Throws Error(kInput) unless both have as many frames; names the first one that has no
// counterpart where the names' numbers tell.
void CheckSameFrames(const FrameFolder& reference, const FrameFolder& sequence);

}  // namespace regrade
