// The box of an object on a transparent background: what lies inside of its outline in every
// view.
#pragma once

#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "reconstruct/scene/normalize_scene.h"

namespace regrade {

// A view's alpha: [H, W, 1] in [0, 1] at the camera's own size; the camera is in the capture's
// world.
struct Silhouette {
  Camera camera;
  Image alpha;
};

// `scene`, its box shrunk to the visual hull (at 96 vertices a side, and one more round it),
// scaled so that the longest half side is 1 again. Unchanged if the hull is empty: then the
// outlines do not fit the poses.
NormalizedScene TightenToSilhouettes(const NormalizedScene& scene,
                                     const std::vector<Silhouette>& silhouettes);

}  // namespace regrade
