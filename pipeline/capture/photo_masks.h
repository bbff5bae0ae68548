// --photo-masks: masks of what moved between photos; masked parts are neither matched nor
// fitted.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"

namespace regrade {

// Writes `folder`/00007.png.png, of the photo's size, for each photo that has a mask in
// `masks`: its path, or an empty text. As COLMAP needs them: black where no feature is
// extracted, white elsewhere, split at mid-grey. Returns their number. Throws Error(kInput) for
// a mask of another aspect than its photo, and one without anything brighter than mid-grey.
int StageMasks(const std::vector<std::string>& masks, const std::vector<StagedPhoto>& photos,
               const std::string& folder);

// The same for the pictures of the folder `masks` that have the photos' names (photo_names.h).
// Throws Error(kInput) for a missing folder and one without a mask of any photo, too.
int StagePhotoMasks(const std::string& masks, const std::vector<StagedPhoto>& photos,
                    const std::string& folder);

// Path of the mask of a staged photo, if it has one: poses/masks/00007.png.png for
// poses/photos/00007.png.
std::string StagedMaskOf(const std::string& photo_path);

}  // namespace regrade
