#include "pipeline/fields/path_clearance.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/splats/covariance.h"
#include "kernels/splats/splat_field.h"
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

// Of each of the path's segments.
std::vector<double> VoxelDepthAlong(const RadianceField& field,
                                    const std::vector<Vec3d>& path) {
  const FieldSampler sampler(*field.geometry);
  const Vec3f scale = field.geometry->frame.Scale();
  const double step = 0.5 / std::max({scale.x, scale.y, scale.z});
  std::vector<double> depth;
  for (size_t i = 1; i < path.size(); ++i)
    depth.push_back(OpticalDepth(sampler, path[i - 1], path[i], step));
  return depth;
}

std::array<double, 4> Widened(const float* quaternion) {
  return {quaternion[0], quaternion[1], quaternion[2], quaternion[3]};
}

double NormalBelow(double x) { return 0.5 * std::erfc(-x * M_SQRT1_2); }

}  // namespace

std::vector<double> SplatDepthAlong(const RadianceField& field,
                                    const std::vector<Vec3d>& path) {
  constexpr double kFarthest = 4;  // standard deviations
  const SplatsView<float> splats = SplatsOf(field);
  std::vector<double> depth(path.size() - 1);
#pragma omp parallel for schedule(dynamic, 1)
  for (size_t k = 0; k < depth.size(); ++k) {
    const Vec3d middle = (path[k] + path[k + 1]) * 0.5, half = (path[k + 1] - path[k]) * 0.5;
    double sum = 0;
    for (int64_t i = 0; i < splats.count; ++i) {
      if (!IsUsable(splats, i)) continue;
      const Splat<float> splat = splats[i];
      const Vec3d scale = splat.log_scale.Cast<double>(), mean = splat.mean.Cast<double>();
      const double longest = std::exp(std::max({scale.x, scale.y, scale.z}));
      if (Norm(mean - middle) > kFarthest * longest + Norm(half)) continue;
      // In the splat's own axes, in standard deviations.
      const Mat3d axes_from_world = RotationOf(Widened(splat.quaternion).data()).Transposed();
      Vec3d m = axes_from_world * (middle - mean), h = axes_from_world * half;
      for (int a = 0; a < 3; ++a) {
        const double inverse = std::exp(-scale[a]);
        m[a] *= inverse, h[a] *= inverse;
      }
      const double length = Norm(h);
      if (!(length > 0) || !std::isfinite(length) || !AllFinite(m)) continue;
      const double along = Dot(m, h) / length;
      const double alpha =
          std::min(kMaxAlpha, std::exp(-0.5 * (Dot(m, m) - along * along)) /
                                  (1 + std::exp(-double{splat.opacity_logit})));
      sum -= std::log1p(-alpha) * (NormalBelow(along + length) - NormalBelow(along - length));
    }
    depth[k] = sum;
  }
  return depth;
}

PathClearance MeasureClearance(const RadianceField& field, const std::vector<Camera>& photos,
                               const std::vector<Camera>& path) {
  PathClearance clearance;
  const double spacing = Spacing(photos);
  if (!(spacing > 0) || path.size() < 2) return clearance;
  std::vector<Vec3d> places;
  for (const Camera& camera : path) places.push_back(camera.Center());
  const std::vector<double> of_segment = field.geometry->splats.on()
                                             ? SplatDepthAlong(field, places)
                                             : VoxelDepthAlong(field, places);
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
