// A place on Earth, and places near each other in meters.
#pragma once

#include <vector>

#include "kernels/base/vec.h"

namespace regrade {

// WGS 84. `altitude` in meters above whatever the file counts from; 0 where it is unknown.
struct GeoPosition {
  double latitude = 0;   // degrees, north is positive
  double longitude = 0;  // degrees, east is positive
  double altitude = 0;
  bool operator==(const GeoPosition&) const = default;
};

// East, north and up in meters from the first place, on the plane that touches the Earth's mean
// sphere there: the ellipsoid makes relative errors of 0.5 %, the distance d of d^2 / R^2.
std::vector<Vec3d> LocalMeters(const std::vector<GeoPosition>& places);

}  // namespace regrade
