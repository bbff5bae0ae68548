// Measures whether a camera path keeps to free space and to where photos were taken.
#pragma once

#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"

namespace regrade {

struct PathClearance {
  // The least transmittance of a stretch of the path as long as the photos' spacing: 1 in free
  // space, 0 through a wall.
  double transmittance = 1;
  // The largest distance of the path to the nearest photo, in the photos' spacing: the mean
  // distance of neighbours along their tour.
  double photo_distance = 0;
};

// A path with a lower transmittance passes through surfaces: haze of a fit leaves 0.8 and more.
inline constexpr double kClearTransmittance = 0.5;

// All cameras in the field's frame, which is not that of device coordinates (NdcSpace). Optical
// depths along the path are those of optical_depth.h.
PathClearance MeasureClearance(const RadianceField& field, const std::vector<Camera>& photos,
                               const std::vector<Camera>& path);

}  // namespace regrade
