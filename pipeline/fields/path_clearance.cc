#include "pipeline/fields/path_clearance.h"

#include <algorithm>
#include <cmath>

#include "kernels/render/optical_depth.h"
#include "pipeline/fields/camera_path.h"

namespace regrade {
namespace {

// World units; 0 for photos in one place.
double Spacing(const std::vector<Camera>& photos) {
  if (photos.size() < 2) return 0;
  const std::vector<int> order = SmoothOrder(photos);
  double length = 0;
  for (size_t i = 1; i < order.size(); ++i)
    length += Norm(photos[static_cast<size_t>(order[i])].Center() -
                   photos[static_cast<size_t>(order[i - 1])].Center());
  return length / static_cast<double>(order.size() - 1);
}

}  // namespace

PathClearance MeasureClearance(const RadianceField& field, const std::vector<Camera>& photos,
                               const std::vector<Camera>& path) {
  PathClearance clearance;
  const double spacing = Spacing(photos);
  if (!(spacing > 0) || path.size() < 2) return clearance;
  std::vector<Vec3d> places;
  for (const Camera& camera : path) places.push_back(camera.Center());
  const std::vector<double> of_segment = OpticalDepths(field, places);
  std::vector<double> at(path.size(), 0.0), depth(path.size(), 0.0);  // since the beginning
  size_t first = 0;  // of the stretch that ends at i
  for (size_t i = 0; i < path.size(); ++i) {
    const Vec3d place = places[i];
    double nearest = 1e300;
    for (const Camera& photo : photos)
      nearest = std::min(nearest, Norm(photo.Center() - place));
    clearance.photo_distance = std::max(clearance.photo_distance, nearest / spacing);
    if (i == 0) continue;
    const Vec3d before = places[i - 1];
    at[i] = at[i - 1] + Norm(place - before);
    depth[i] = depth[i - 1] + of_segment[i - 1];
    while (at[i] - at[first] > spacing && first + 1 < i) ++first;
    clearance.transmittance =
        std::min(clearance.transmittance, std::exp(depth[first] - depth[i]));
  }
  return clearance;
}

}  // namespace regrade
