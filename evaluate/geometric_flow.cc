#include "evaluate/geometric_flow.h"

#include <cmath>
#include <limits>

#include "kernels/base/error.h"
#include "kernels/image/warp.h"

namespace regrade {
namespace {

constexpr double kTapTolerance = 0.05;    // fraction of the depth
constexpr double kPointTolerance = 0.01;  // fraction of the depth

BilinearTaps FlowTaps(const FlowField& flow, int x, int y) {
  const float* f = flow.at(x, y);
  return TapsAt(x + static_cast<double>(f[0]), y + static_cast<double>(f[1]), flow.width,
                flow.height);
}

bool Something(float depth) { return depth > 0 && std::isfinite(depth); }

void CheckDepth(const Image& depth, const Camera& camera) {
  REGRADE_CHECK_EQ(depth.channels, 1);
  REGRADE_CHECK_EQ(depth.width, camera.width);
  REGRADE_CHECK_EQ(depth.height, camera.height);
}

// 1 / z in the camera's frame for each pixel; 0 without a surface.
std::vector<double> InverseZ(const Image& depth, const Camera& camera) {
  std::vector<double> inverse(depth.pixels.size(), 0.0);
#pragma omp parallel for schedule(static)
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      const float d = *depth.at(x, y);
      if (!Something(d)) continue;
      const Vec3d ray = Normalized(camera.CameraRay(x + 0.5, y + 0.5));
      if (ray.z > 0) inverse[static_cast<size_t>(y) * depth.width + x] = 1 / (d * ray.z);
    }
  return inverse;
}

bool DepthAgrees(const BilinearTaps& taps, const std::vector<double>& inverse_z, int width,
                 double z) {
  double sum = 0;
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) {
      const size_t index =
          static_cast<size_t>(j ? taps.y1 : taps.y0) * width + (i ? taps.x1 : taps.x0);
      const double ratio = inverse_z[index] * z;  // 1 for the same depth, 0 without a surface
      if (!(std::abs(ratio - 1) <= kTapTolerance)) return false;
      sum += ratio * (i ? taps.ax : 1 - taps.ax) * (j ? taps.ay : 1 - taps.ay);
    }
  return std::abs(sum - 1) <= kPointTolerance;
}

}  // namespace

FlowField GeometricFlow(const Image& depth_i, const Camera& camera_i, const Image& depth_j,
                        const Camera& camera_j, Image* visible) {
  CheckDepth(depth_i, camera_i);
  CheckDepth(depth_j, camera_j);
  REGRADE_CHECK(depth_i.SameSize(depth_j));
  const int width = depth_i.width, height = depth_i.height;
  FlowField flow(width, height);
  std::vector<double> inverse_z;
  if (visible != nullptr) {
    *visible = Image(width, height, 1);
    inverse_z = InverseZ(depth_j, camera_j);
  }
  const RigidTransform world_from_i = camera_i.camera_from_world.Inverse();
#pragma omp parallel for schedule(static)
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      float* f = flow.at(x, y);
      f[0] = f[1] = std::numeric_limits<float>::quiet_NaN();
      const float depth = *depth_i.at(x, y);
      if (!Something(depth)) continue;
      const Vec3d ray = Normalized(camera_i.CameraRay(x + 0.5, y + 0.5));
      double u, v, z;
      if (!camera_j.Project(world_from_i * (ray * static_cast<double>(depth)), &u, &v, &z))
        continue;
      f[0] = static_cast<float>(u - 0.5 - x);
      f[1] = static_cast<float>(v - 0.5 - y);
      if (visible == nullptr) continue;
      // From the rounded flow, so that warping with it uses the same taps.
      const BilinearTaps taps = FlowTaps(flow, x, y);
      if (taps.four_taps && DepthAgrees(taps, inverse_z, width, z)) *visible->at(x, y) = 1;
    }
  return flow;
}

OcclusionMask GeometricMask(const FlowField& flow, const Image& visible) {
  REGRADE_CHECK_EQ(flow.width, visible.width);
  REGRADE_CHECK_EQ(flow.height, visible.height);
  OcclusionMask mask;
  mask.weight = visible;
  for (int y = 0; y < flow.height; ++y)
    for (int x = 0; x < flow.width; ++x) {
      const float* f = flow.at(x, y);
      if (!std::isfinite(f[0]) || !std::isfinite(f[1]))
        ++mask.not_finite;
      else if (!FlowTaps(flow, x, y).four_taps)
        ++mask.out_of_frame;
      else if (*visible.at(x, y) == 0)
        ++mask.disoccluded;
    }
  return mask;
}

}  // namespace regrade
