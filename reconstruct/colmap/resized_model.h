// A model whose pictures have been resampled since it was made: its cameras at the sizes that
// the photos have now.
#pragma once

#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// Images whose photo (by staged name) has another size than their camera, but its shape to a
// pixel, get a camera of that size, and keypoints to match. Returns their number. Photos of
// another shape are left: CaptureFromModel refuses them.
int ResizeToPhotos(const std::vector<StagedPhoto>& photos, ColmapModel* model);

}  // namespace regrade
