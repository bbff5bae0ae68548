// Masks of what moved while the photos were taken: their parts are neither matched nor fitted.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/files/json_file.h"

namespace regrade {

// Writes `folder`/00007.png.png for each photo that `masks` has a picture for, by name less
// extension (or with it: IMG_7.jpg.png), of the photo's size, as COLMAP wants them: black where
// no feature is looked for, white elsewhere; what is nearer to black is black. Returns their
// number. Throws Error(kInput) for a missing folder, one without a mask of a photo, a mask of
// another shape than its photo, and one that is black all over.
int StagePhotoMasks(const std::string& masks, const std::vector<StagedPhoto>& photos,
                    const std::string& folder);

// Where the mask of a staged photo lies, if it has one: poses/masks/00007.png.png for
// poses/photos/00007.png.
std::string StagedMaskOf(const std::string& photo_path);

// Hashes of the masks, as part of a stage's inputs. Throws Error(kInput) for a missing folder.
JsonValue PhotoMaskFiles(const std::string& masks);

}  // namespace regrade
