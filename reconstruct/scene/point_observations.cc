#include "reconstruct/scene/point_observations.h"

#include <algorithm>
#include <cmath>

namespace regrade {

std::vector<std::vector<SeenPoint>> PointsSeenBy(const Capture& capture,
                                                 const std::vector<int>& views,
                                                 const Similarity& field_from_world,
                                                 double pixel_error) {
  std::vector<int> place(capture.views.size(), -1);  // in `views`
  for (size_t i = 0; i < views.size(); ++i)
    place[static_cast<size_t>(views[i])] = static_cast<int>(i);
  std::vector<Vec3d> centers;
  for (const CaptureView& view : capture.views) centers.push_back(view.camera.Center());
  std::vector<std::vector<SeenPoint>> seen(views.size());
  std::vector<size_t> observers;
  for (const ScenePoint& point : capture.points) {
    observers.clear();
    for (const int32_t view : point.views)
      if (place[static_cast<size_t>(view)] >= 0) observers.push_back(static_cast<size_t>(view));
    const Vec3f position = (field_from_world * point.position).Cast<float>();
    for (const size_t view : observers) {
      // A pixel's angle over the sine of the largest angle to another observer's ray.
      const Vec3d ray = point.position - centers[view];
      const double distance = Norm(ray);
      double sine = 0;
      for (const size_t other : observers) {
        const Vec3d across = point.position - centers[other];
        sine = std::max(sine, Norm(Cross(ray, across)) / (distance * Norm(across)));
      }
      const double sigma = pixel_error / capture.views[view].camera.fx * distance / sine;
      if (!(sigma < distance / 2)) continue;
      seen[static_cast<size_t>(place[view])].push_back(
          {position, static_cast<float>(field_from_world.scale * sigma)});
    }
  }
  return seen;
}

}  // namespace regrade
