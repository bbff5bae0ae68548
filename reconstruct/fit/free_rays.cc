#include "reconstruct/fit/free_rays.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/base/random.h"
#include "kernels/base/random_streams.h"

namespace regrade {
namespace {

constexpr size_t kPointsBeside = 8;
constexpr double kFreePart = 0.8;  // of the distance of the nearest point beside a pixel

struct ImagePoint {
  double u, v;      // pixels
  double distance;  // to the camera, the field's unit
};

// The ray through (u, v), free up to `distance` from the camera (the field's unit) less
// `margin`.
FreeRay RayThrough(const Camera& camera, double u, double v, double distance, double margin) {
  RayT<double> ray = camera.WorldRay(u, v);
  Vec3d end = ray.origin + ray.direction * distance;
  if (camera.ndc.on()) {
    if (!(end.z > 1)) return {};  // before the near plane
    end = NdcFromWorld(camera.ndc, end);
    NdcRay(camera.ndc, &ray.origin, &ray.direction);
  }
  const double length = Dot(end - ray.origin, ray.direction) - margin;
  return {{ray.origin.Cast<float>(), ray.direction.Cast<float>()}, static_cast<float>(length)};
}

void AddSeenPoints(const TrainingView& view, double margin, std::vector<ImagePoint>* image,
                   std::vector<FreeRay>* rays) {
  const Camera& camera = view.camera;
  for (const SeenPoint& point : view.points) {
    const Vec3d position = point.position.Cast<double>();
    const double distance = Norm(position - camera.Center());
    double u, v;
    if (!camera.Project(position, &u, &v) || !(u >= 0 && v >= 0 && u <= camera.width) ||
        !(v <= camera.height))
      continue;
    image->push_back({u, v, distance});
    const FreeRay ray =
        RayThrough(camera, u, v, distance - static_cast<double>(point.sigma), margin);
    if (ray.length > 0) rays->push_back(ray);
  }
}

// Distance of the nearest of the points beside (u, v).
double NearestBeside(const std::vector<ImagePoint>& points, double u, double v) {
  std::array<std::pair<double, double>, kPointsBeside> beside;  // squared pixels, distance
  size_t count = 0;
  for (const ImagePoint& p : points) {
    const std::pair<double, double> entry{(p.u - u) * (p.u - u) + (p.v - v) * (p.v - v),
                                          p.distance};
    if (count < kPointsBeside) {
      beside[count++] = entry;
      std::push_heap(beside.begin(), beside.begin() + static_cast<std::ptrdiff_t>(count));
    } else if (entry < beside[0]) {
      std::pop_heap(beside.begin(), beside.end());
      beside.back() = entry;
      std::push_heap(beside.begin(), beside.end());
    }
  }
  return std::min_element(beside.begin(), beside.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->second;
}

}  // namespace

std::vector<FreeRay> FreeRays(const std::vector<TrainingView>& views, double margin,
                              uint64_t seed) {
  std::vector<std::vector<FreeRay>> of_view(views.size());
#pragma omp parallel for schedule(dynamic, 1)
  for (size_t i = 0; i < views.size(); ++i) {
    const Camera& camera = views[i].camera;
    std::vector<ImagePoint> image;
    AddSeenPoints(views[i], margin, &image, &of_view[i]);
    if (image.size() < kPointsBeside) continue;
    for (size_t n = 0; n < image.size(); ++n) {
      const double u = camera.width * RandomDouble(seed ^ kRandomFreeSpace, i, 2 * n);
      const double v = camera.height * RandomDouble(seed ^ kRandomFreeSpace, i, 2 * n + 1);
      const FreeRay ray = RayThrough(camera, u, v, kFreePart * NearestBeside(image, u, v), 0);
      if (ray.length > 0) of_view[i].push_back(ray);
    }
  }
  std::vector<FreeRay> rays;
  for (const auto& part : of_view) rays.insert(rays.end(), part.begin(), part.end());
  return rays;
}

}  // namespace regrade
