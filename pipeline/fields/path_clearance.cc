#include "pipeline/fields/path_clearance.h"

#include <algorithm>
#include <cmath>

#include "pipeline/fields/camera_path.h"
#include "pipeline/fields/field_sampler.h"

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

Vec3f Rounded(const Vec3d& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

// Optical depth of the straight line between two points.
double OpticalDepth(const FieldSampler& sampler, const Vec3d& a, const Vec3d& b, double step) {
  constexpr int kMost = 4096;
  const double length = Norm(b - a);
  const int samples = std::clamp(static_cast<int>(std::ceil(length / step)), 1, kMost);
  double sum = 0;
  for (int i = 0; i < samples; ++i)
    sum += static_cast<double>(sampler.DensityAt(Rounded(a + (b - a) * ((i + 0.5) / samples))));
  return sum * length / samples;
}

}  // namespace

PathClearance MeasureClearance(const RadianceField& field, const std::vector<Camera>& photos,
                               const std::vector<Camera>& path) {
  PathClearance clearance;
  const double spacing = Spacing(photos);
  if (!(spacing > 0) || path.size() < 2) return clearance;
  const FieldSampler sampler(*field.geometry);
  const Vec3f scale = field.geometry->frame.Scale();
  const double step = 0.5 / std::max({scale.x, scale.y, scale.z});
  std::vector<double> at(path.size(), 0.0), depth(path.size(), 0.0);  // since the beginning
  size_t first = 0;  // of the stretch that ends at i
  for (size_t i = 0; i < path.size(); ++i) {
    const Vec3d place = path[i].Center();
    double nearest = 1e300;
    for (const Camera& photo : photos)
      nearest = std::min(nearest, Norm(photo.Center() - place));
    clearance.photo_distance = std::max(clearance.photo_distance, nearest / spacing);
    if (i == 0) continue;
    const Vec3d before = path[i - 1].Center();
    at[i] = at[i - 1] + Norm(place - before);
    depth[i] = depth[i - 1] + OpticalDepth(sampler, before, place, step);
    while (at[i] - at[first] > spacing && first + 1 < i) ++first;
    clearance.transmittance =
        std::min(clearance.transmittance, std::exp(depth[first] - depth[i]));
  }
  return clearance;
}

}  // namespace regrade
