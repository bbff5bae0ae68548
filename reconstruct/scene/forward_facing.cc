#include "reconstruct/scene/forward_facing.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/base/quantile.h"
#include "kernels/scene/common_camera.h"

namespace regrade {
namespace {

constexpr double kNearestTail = 0.01;  // fraction of observations that may be nearer: outliers
constexpr double kNearFactor = 0.75;   // the near plane, as a fraction of the nearest depth
constexpr int kLayers = 128;           // along z, as in svox2's LLFF configuration
constexpr double kLargestRadius = 2;   // half side in NDC; the mean camera sees 1

Vec3d MeanForward(const Capture& capture) {
  Vec3d sum{};
  for (const CaptureView& view : capture.views) sum += view.camera.Forward();
  return Norm(sum) > 1e-9 ? Normalized(sum) : Vec3d{0, 0, 1};
}

double NearestDepth(const Capture& capture) {
  if (capture.nearest_depth > 0) return capture.nearest_depth;  // given, not estimated
  std::vector<double> depths;
  for (const ScenePoint& point : capture.points)
    for (const int32_t v : point.views) {
      const Camera& camera = capture.views[v].camera;
      const double depth = (camera.camera_from_world * point.position).z;
      if (depth > 0) depths.push_back(depth);
    }
  if (depths.size() < 50) return 0;
  return Quantile(std::move(depths), kNearestTail);
}

}  // namespace

ForwardFacing MeasureForwardFacing(const Capture& capture) {
  ForwardFacing result;
  const Vec3d forward = MeanForward(capture);
  double low = 1e300, high = -1e300;
  for (const CaptureView& view : capture.views) {
    const double cosine = std::clamp(Dot(view.camera.Forward(), forward), -1.0, 1.0);
    result.angle_deg = std::max(result.angle_deg, std::acos(cosine) * 180 / M_PI);
    low = std::min(low, Dot(view.camera.Center(), forward));
    high = std::max(high, Dot(view.camera.Center(), forward));
  }
  result.nearest = NearestDepth(capture);
  result.depth_fraction = result.nearest > 0 ? (high - low) / result.nearest : 1e9;
  result.on = capture.views.size() >= 3 && result.angle_deg <= kForwardAngle &&
              result.depth_fraction <= kForwardDepthFraction;
  return result;
}

NormalizedScene NormalizeForwardFacing(const Capture& capture, const ForwardFacing& measured,
                                       double margin) {
  Vec3d up{}, center{};
  const double weight = 1.0 / static_cast<double>(capture.views.size());
  for (const CaptureView& view : capture.views) {
    up += view.camera.Up();
    center += view.camera.Center() * weight;
  }
  NormalizedScene result;
  Similarity& s = result.field_from_world;
  const Vec3d forward = MeanForward(capture);
  const Vec3d right = Normalized(Cross(forward, up));
  s.rotation.row[0] = right;
  s.rotation.row[1] = Cross(forward, right);  // down
  s.rotation.row[2] = forward;
  s.scale = 1 / (kNearFactor * measured.nearest);
  s.translation = -(s.scale * (s.rotation * center));

  std::vector<Camera> cameras;
  for (const CaptureView& view : capture.views) cameras.push_back(view.camera);
  const Camera common = CommonCamera(cameras);
  result.ndc = {2 * common.fx / common.width, 2 * common.fy / common.height};
  double radius_x = 1, radius_y = 1;
  for (const CaptureView& view : capture.views) {
    const Camera camera = view.camera.Transformed(s);
    if (!(camera.Center().z < 1))
      throw SceneError("its camera is in front of the near plane of the capture", view.file,
                       "leave this photo out");
    for (const double u : {0.5, camera.width - 0.5})
      for (const double v : {0.5, camera.height - 0.5}) {
        RayT<double> ray = camera.WorldRay(u, v);
        NdcRay(result.ndc, &ray.origin, &ray.direction);
        if (!(ray.direction.z > 0))
          throw SceneError("its camera looks sideways or backwards", view.file,
                           "leave this photo out");
        const Vec3d far = ray.origin + ray.direction * (2 / ray.direction.z);
        radius_x = std::max({radius_x, std::abs(ray.origin.x), std::abs(far.x)});
        radius_y = std::max({radius_y, std::abs(ray.origin.y), std::abs(far.y)});
      }
  }
  if (margin > 0) {
    const double beyond = 2 * margin * std::max(common.width, common.height);
    radius_x = 1 + beyond / common.width;
    radius_y = 1 + beyond / common.height;
  }
  result.box.radius = {static_cast<float>(std::min(radius_x, kLargestRadius)),
                       static_cast<float>(std::min(radius_y, kLargestRadius)), 1};
  result.box.layers = kLayers;
  result.box.voxel_aspect = VoxelAspect(result.ndc);
  return result;
}

}  // namespace regrade
