// Views from between and beside the places of a capture's photos.
#pragma once

#include <vector>

#include "kernels/scene/camera.h"

namespace regrade {

// In the frame of the given cameras; all are pinholes.
struct NearbyViews {
  std::vector<Camera> fitted, measured;
};

// `fitted`: the photos' own views, or evenly some of them, and then views between neighbours of
// the photos' tour (SmoothOrder), moved sideways and up by a part of their distance, until they
// are `most`, at least 2. `measured`: kMeasuredNearby others of the moved ones, at other
// places. Of one camera all are its own. Equal cameras give equal views.
inline constexpr int kMeasuredNearby = 6;
NearbyViews ViewsNear(const std::vector<Camera>& cameras, int most);

}  // namespace regrade
