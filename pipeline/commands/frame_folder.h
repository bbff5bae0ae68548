// Opens a folder of frames of any program and checks them before work begins.
#pragma once

#include <string>
#include <vector>

#include "evaluate/frame_source.h"
#include "kernels/base/progress.h"
#include "pipeline/images/kept_pictures.h"

namespace regrade {

struct FrameFolder {
  std::string folder;
  std::vector<std::string> paths;  // in natural order of names
  std::vector<std::string> names;  // relative to the folder
  std::vector<int> places;         // of the frames among all of the folder, from 0
  int width = 0, height = 0;       // of every frame
  std::string notice;  // what of the frames is used in a way that may surprise; or empty
  KeptPictures kept{KeptPictures::Origin::kGiven};  // the frames, as far as they fit

  FrameSource Source() const;
};

// Lists the folder and decodes each frame once, so that errors appear early: a damaged or
// unreadable file, frames of different sizes, a number missing from evenly numbered names (the
// pairs across it would be further apart than their gap), a number that two files share; see
// FrameNumbers. The notice says where frames have alpha (it is ignored) or more than 8 bits.
// Progress counts frames.
//
// Errors: kInput, with the file.
FrameFolder OpenFrameFolder(const std::string& folder, const ProgressFunction& progress = {});

}  // namespace regrade
