#include "kernels/render/optical_depth.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/field/trilinear.h"
#include "kernels/render/render_kind.h"
#include "kernels/splats/covariance.h"
#include "kernels/splats/splat_field.h"

namespace regrade {
namespace {

Vec3f Rounded(const Vec3d& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

// Of voxels, per world unit of length at a point in world units; 0 outside of the box.
float DensityAt(const Geometry& geometry, const Vec3f& world) {
  const GridFrame& frame = geometry.frame;
  const Vec3f scale = frame.Scale();
  Vec3f place;  // voxels from the box's lowest corner
  for (int a = 0; a < 3; ++a) {
    place[a] = (world[a] - frame.center[a] + frame.radius[a]) * scale[a];
    if (!(place[a] >= 0 && place[a] <= static_cast<float>(frame.resolution[a]))) return 0;
  }
  float density;
  Interpolate(frame, geometry.links.data(), geometry.density.data(), 1, 1,
              LocateCell(frame, place - Vec3f{0.5f, 0.5f, 0.5f}), &density);
  return std::max(density, 0.0f);
}

// Of a field of voxels: the optical depth of the straight line between two points.
double DepthBetween(const Geometry& geometry, const Vec3d& a, const Vec3d& b, double step) {
  constexpr int kMost = 4096;
  const double length = Norm(b - a);
  const int samples = std::clamp(static_cast<int>(std::ceil(length / step)), 1, kMost);
  double sum = 0;
  for (int i = 0; i < samples; ++i)
    sum += double{DensityAt(geometry, Rounded(a + (b - a) * ((i + 0.5) / samples)))};
  return sum * length / samples;
}

std::array<double, 4> Widened(const float* quaternion) {
  return {quaternion[0], quaternion[1], quaternion[2], quaternion[3]};
}

double NormalBelow(double x) { return 0.5 * std::erfc(-x * M_SQRT1_2); }

}  // namespace

std::vector<double> OpticalDepths(const RadianceField& field, const std::vector<Vec3d>& path) {
  return RenderKindOf(*field.geometry).optical_depths(field, path);
}

std::vector<double> VoxelDepthAlong(const RadianceField& field,
                                    const std::vector<Vec3d>& path) {
  const Geometry& geometry = *field.geometry;
  const Vec3f scale = geometry.frame.Scale();
  const double step = 0.5 / std::max({scale.x, scale.y, scale.z});
  std::vector<double> depth;
  for (size_t i = 1; i < path.size(); ++i)
    depth.push_back(DepthBetween(geometry, path[i - 1], path[i], step));
  return depth;
}

std::vector<double> SplatDepthAlong(const RadianceField& field,
                                    const std::vector<Vec3d>& path) {
  constexpr double kFarthest = 4;  // standard deviations
  const SplatsView<float> splats = SplatsOf(field);
  std::vector<double> reach(static_cast<size_t>(splats.count));  // negative: not drawn
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < splats.count; ++i) {
    const Vec3d scale = splats[i].log_scale.Cast<double>();
    reach[static_cast<size_t>(i)] =
        IsUsable(splats, i) ? kFarthest * std::exp(std::max({scale.x, scale.y, scale.z})) : -1;
  }
  std::vector<double> depth(path.size() - 1);
#pragma omp parallel for schedule(dynamic, 1)
  for (size_t k = 0; k < depth.size(); ++k) {
    const Vec3d middle = (path[k] + path[k + 1]) * 0.5, half = (path[k + 1] - path[k]) * 0.5;
    double sum = 0;
    for (int64_t i = 0; i < splats.count; ++i) {
      const Vec3d mean{splats.mean[3 * i], splats.mean[3 * i + 1], splats.mean[3 * i + 2]};
      const double reached = reach[static_cast<size_t>(i)];
      if (reached < 0 || Norm(mean - middle) > reached + Norm(half)) continue;
      const Splat<float> splat = splats[i];
      const Vec3d scale = splat.log_scale.Cast<double>();
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

}  // namespace regrade
