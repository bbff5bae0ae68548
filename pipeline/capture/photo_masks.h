// --photo-masks: masks of what moved between photos; masked parts are neither matched nor
// fitted.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"

namespace regrade {

// Writes `folder`/00007.png.png, of the photo's size, for each photo that has a picture in
// `masks`, by its name without or with extension (IMG_7.png, IMG_7.jpg.png). As COLMAP needs
// them: black where no feature is extracted, white elsewhere, split at mid-grey. Returns their
// number. Throws Error(kInput) for a missing folder, one without a mask of any photo, a mask of
// another aspect than its photo, and one that is entirely black.
int StagePhotoMasks(const std::string& masks, const std::vector<StagedPhoto>& photos,
                    const std::string& folder);

// Path of the mask of a staged photo, if it has one: poses/masks/00007.png.png for
// poses/photos/00007.png.
std::string StagedMaskOf(const std::string& photo_path);

}  // namespace regrade
