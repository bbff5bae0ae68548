#include "kernels/scene/geo_position.h"

#include <cmath>

namespace regrade {
namespace {

constexpr double kEarthRadius = 6371008.8;  // meters, the ellipsoid's mean

}  // namespace

std::vector<Vec3d> LocalMeters(const std::vector<GeoPosition>& places) {
  std::vector<Vec3d> meters;
  meters.reserve(places.size());
  for (const GeoPosition& place : places) {
    const GeoPosition& origin = places.front();
    // The short way round, across the date line, too.
    const double east = std::remainder(place.longitude - origin.longitude, 360.0);
    const double radian = kEarthRadius * M_PI / 180;
    meters.push_back({radian * east * std::cos(origin.latitude * M_PI / 180),
                      radian * (place.latitude - origin.latitude),
                      place.altitude - origin.altitude});
  }
  return meters;
}

}  // namespace regrade
