// Staged photos as COLMAP can read them.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"

namespace regrade {

// COLMAP 3.8 reads no PNG of 16 bits a channel ("Failed to read image file format"). Where
// there are such photos, writes all photos to `folder`, which is emptied first, with 8 bits,
// and returns them with these paths; otherwise returns `photos`. Throws Error(kInput,
// kResources).
std::vector<StagedPhoto> PhotosForColmap(const std::vector<StagedPhoto>& photos,
                                         const std::string& folder);

}  // namespace regrade
