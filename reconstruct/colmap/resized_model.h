// Adapts a model's cameras to photos that were resized after the model was made.
#pragma once

#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// Whether pictures of width x height are the camera's in another size; tolerates that each side
// is rounded to whole pixels.
bool SameAspect(const Camera& camera, int width, int height);

// Gives images whose photo (by staged name) has another size than their camera, but the same
// aspect ratio to a pixel, a camera of that size and scaled keypoints. Returns the number of
// those images. Skips photos of another aspect ratio: CaptureFromModel refuses them.
int ResizeToPhotos(const std::vector<StagedPhoto>& photos, ColmapModel* model);

}  // namespace regrade
