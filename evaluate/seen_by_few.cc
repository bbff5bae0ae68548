#include "evaluate/seen_by_few.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr double kDepthTolerance = 0.05;  // fraction of the depth, as of geometric flow
constexpr int kPointStride = 2;           // of samples
constexpr int kMiddle = kDepthStride / 2;

// The centre of a sample's pixel along an axis, in pixels.
double CenterOf(int sample, int size) {
  return std::min(sample * kDepthStride + kMiddle, size - 1) + 0.5;
}

bool Sees(const SampledView& photo, const Vec3d& point, double near) {
  double u, v, z;
  if (!photo.camera.Project(point, &u, &v, &z) || !(z > near)) return false;
  if (!(u >= 0 && v >= 0 && u < photo.camera.width && v < photo.camera.height)) return false;
  const Image& depth = photo.depth;
  const double x = (u - 0.5 - kMiddle) / kDepthStride, y = (v - 0.5 - kMiddle) / kDepthStride;
  const auto at = [&](double i, double j) {
    return *depth.at(std::clamp(static_cast<int>(i), 0, depth.width - 1),
                     std::clamp(static_cast<int>(j), 0, depth.height - 1));
  };
  if (at(std::round(x), std::round(y)) < 0) return false;
  double farthest = 0;
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) {
      const double d = at(std::floor(x) + i, std::floor(y) + j);
      farthest = std::max(farthest, d == 0 ? std::numeric_limits<double>::infinity() : d);
    }
  return z <= (1 + kDepthTolerance) * farthest;
}

}  // namespace

SampledView SampleView(const Camera& camera, const Image& depth, const Image& kept) {
  REGRADE_CHECK(depth.width == camera.width && depth.height == camera.height);
  REGRADE_CHECK(kept.empty() || (kept.width == depth.width && kept.height == depth.height));
  const auto samples = [](int size) { return (size + kDepthStride - 1) / kDepthStride; };
  SampledView view{camera, Image(samples(depth.width), samples(depth.height), 1)};
  for (int y = 0; y < view.depth.height; ++y)
    for (int x = 0; x < view.depth.width; ++x) {
      const int column = static_cast<int>(CenterOf(x, depth.width)),
                row = static_cast<int>(CenterOf(y, depth.height));
      const bool masked = !kept.empty() && *kept.at(column, row) == 0;
      *view.depth.at(x, y) = masked ? -1.0f : *depth.at(column, row);
    }
  return view;
}

std::optional<double> SeenByFew(const SampledView& view, const std::vector<SampledView>& photos,
                                double near) {
  const RigidTransform world_from_camera = view.camera.camera_from_world.Inverse();
  int64_t points = 0, few = 0;
#pragma omp parallel for schedule(static) reduction(+ : points, few)
  for (int y = 0; y < view.depth.height; y += kPointStride)
    for (int x = 0; x < view.depth.width; x += kPointStride) {
      const double depth = *view.depth.at(x, y);
      const Vec3d ray = view.camera.CameraRay(CenterOf(x, view.camera.width),
                                              CenterOf(y, view.camera.height));
      if (!(depth > 0 && std::isfinite(depth) && ray.z > 0)) continue;
      const Vec3d point = world_from_camera * (ray * (depth / ray.z));
      int seen = 0;
      for (size_t i = 0; i < photos.size() && seen < kFewestPhotos; ++i)
        seen += Sees(photos[i], point, near);
      ++points;
      few += seen < kFewestPhotos;
    }
  if (points == 0) return std::nullopt;
  return static_cast<double>(few) / static_cast<double>(points);
}

}  // namespace regrade
