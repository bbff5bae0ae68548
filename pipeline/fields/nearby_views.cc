#include "pipeline/fields/nearby_views.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/quantile.h"
#include "kernels/scene/facing.h"
#include "pipeline/fields/camera_path.h"

namespace regrade {
namespace {

constexpr double kAside = 0.35;         // of the distance of neighbours
constexpr double kGolden = 2.39996323;  // the golden angle: no two views move alike
// Neighbours in the tour farther apart than so many times the median, or that look ways of a
// smaller cosine apart, have nothing between them that photos showed.
constexpr double kFarApart = 3, kSameHeading = 0.5;

// As `a` at part 0 and as `b` at part 1, with the intrinsics of `a`.
Camera Between(const Camera& a, const Camera& b, double part) {
  const auto mix = [part](const Vec3d& x, const Vec3d& y) { return x * (1 - part) + y * part; };
  const Vec3d front = Normalized(mix(a.Forward(), b.Forward()));
  const Vec3d right = Normalized(Cross(front, mix(a.Up(), b.Up())));
  Camera camera = a;
  camera.camera_from_world = Facing(mix(a.Center(), b.Center()), front, right);
  return camera;
}

// `count` views along the tour at `phase`, of the distance between them.
std::vector<Camera> Moved(const std::vector<Camera>& tour, int count, double phase) {
  std::vector<double> gaps;
  for (size_t i = 1; i < tour.size(); ++i)
    gaps.push_back(Norm(tour[i].Center() - tour[i - 1].Center()));
  const double gap = gaps.empty() ? 0 : Median(gaps);
  std::vector<Camera> moved;
  for (int k = 0; k < count; ++k) {
    const double at = (k + phase) / count * static_cast<double>(gaps.size());
    const size_t i = std::min(static_cast<size_t>(at), tour.size() - 1);
    const Camera& here = tour[i];
    const Camera& next = tour[std::min(i + 1, tour.size() - 1)];
    const bool near = Norm(next.Center() - here.Center()) <= kFarApart * gap &&
                      Dot(here.Forward(), next.Forward()) > kSameHeading &&
                      Dot(here.Up(), next.Up()) > kSameHeading;
    Camera view = near ? Between(here, next, at - static_cast<double>(i)) : here;
    const double angle = kGolden * (k + phase);
    view.camera_from_world.translation +=
        Vec3d{std::cos(angle), std::sin(angle), 0} * (kAside * gap);
    moved.push_back(view);
  }
  return moved;
}

}  // namespace

NearbyViews ViewsNear(const std::vector<Camera>& cameras, int most) {
  std::vector<Camera> tour;
  for (const int i : SmoothOrder(cameras))
    tour.push_back(cameras[static_cast<size_t>(i)].Undistorted());
  const size_t own = std::min(tour.size(), static_cast<size_t>(most) / 2);
  NearbyViews views;
  for (size_t k = 0; k < own; ++k) views.fitted.push_back(tour[k * tour.size() / own]);
  for (const Camera& moved : Moved(tour, most - static_cast<int>(own), 0.5))
    views.fitted.push_back(moved);
  views.measured = Moved(tour, kMeasuredNearby, 0.37);
  return views;
}

}  // namespace regrade
