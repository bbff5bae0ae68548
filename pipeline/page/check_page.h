// Measures what a page's rounding costs: renders of the page's field against the exact one's.
#pragma once

#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"

namespace regrade {

struct PageCheck {
  double worst_db = 0, mean_db = 0;  // of the views' PSNR
  int views = 0;
};

// With at most `longest` pixels along a side.
Camera SmallerView(const Camera& camera, int longest);

// 24 cameras in the field's frame: 12 of the photos' (evenly spaced), 8 of the smooth path, and
// four that few would choose: at the photos' mean place, looking back, between the first photo
// and what it sees, and turned on its side. At most `longest` pixels along a side. `photos`:
// at least one.
std::vector<Camera> CheckedViews(const std::vector<Camera>& photos, int longest);

PageCheck CheckPage(RadianceField exact, RadianceField page,
                    const std::vector<Camera>& cameras);

}  // namespace regrade
