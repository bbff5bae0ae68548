// Masks of what moved while the photos were taken: their parts are not matched.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/files/json_file.h"

namespace regrade {

// Writes `folder`/00007.png.png for each photo that `masks` has a picture for, by name less
// extension (or with it: IMG_7.jpg.png), of the photo's size, as COLMAP wants them: black where
// no feature is looked for, white elsewhere; what is nearer to black is black. Returns their
// number. Throws Error(kInput) for a missing folder, one without a mask of a photo, and a mask
// of another shape than its photo.
int StagePhotoMasks(const std::string& masks, const std::vector<StagedPhoto>& photos,
                    const std::string& folder);

// Hashes of the masks, as part of a stage's inputs. Throws Error(kInput) for a missing folder.
JsonValue PhotoMaskFiles(const std::string& masks);

}  // namespace regrade
