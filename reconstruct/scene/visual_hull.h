// Shrinks the scene's box to the visual hull of an object on a transparent background.
#pragma once

#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "reconstruct/scene/normalize_scene.h"

namespace regrade {

// A view's alpha: [H, W, 1] in [0, 1] at the camera's size; the camera is in world coordinates.
struct Silhouette {
  Camera camera;
  Image alpha;
};

// `scene` with its box shrunk to the visual hull (sampled at 96 vertices a side, plus one
// around it) and scaled so that the longest half side is 1 again. Unchanged if the hull is
// empty, that is, if the silhouettes are inconsistent with the poses.
NormalizedScene TightenToSilhouettes(const NormalizedScene& scene,
                                     const std::vector<Silhouette>& silhouettes);

}  // namespace regrade
