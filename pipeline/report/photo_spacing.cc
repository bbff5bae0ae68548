#include "pipeline/report/photo_spacing.h"

#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

// The point with the least sum of squared distances to the optical axes, by conjugate gradients
// of the 3x3 equations, which need no inverse where axes are parallel.
Vec3d MiddleOfAxes(const std::vector<CaptureView>& views) {
  const auto apply = [&](const Vec3d& x) {  // sum of x - a (a . x)
    Vec3d sum{};
    for (const CaptureView& view : views) {
      const Vec3d axis = view.camera.Forward();
      sum += x - axis * Dot(axis, x);
    }
    return sum;
  };
  Vec3d rest{}, at{};
  for (const CaptureView& view : views) {
    const Vec3d axis = view.camera.Forward(), center = view.camera.Center();
    rest += center - axis * Dot(axis, center);
  }
  Vec3d direction = rest;
  for (int i = 0; i < 3; ++i) {
    const Vec3d moved = apply(direction);
    const double square = Dot(rest, rest), curvature = Dot(direction, moved);
    if (!(square > 0) || !(curvature > 1e-12 * Dot(direction, direction))) break;
    at += direction * (square / curvature);
    rest = rest - moved * (square / curvature);
    direction = rest + direction * (Dot(rest, rest) / square);
  }
  return at;
}

// [views]: from each photo to what it shows.
std::vector<double> SceneDistances(const Capture& capture) {
  std::vector<std::vector<double>> seen(capture.views.size());
  for (const ScenePoint& point : capture.points)
    for (const int32_t v : point.views) {
      const size_t view = static_cast<size_t>(v);
      seen[view].push_back(Norm(point.position - capture.views[view].camera.Center()));
    }
  const Vec3d middle = MiddleOfAxes(capture.views);
  std::vector<double> distances;
  for (size_t i = 0; i < seen.size(); ++i) {
    std::vector<double>& own = seen[i];
    if (own.empty()) own.push_back(Norm(middle - capture.views[i].camera.Center()));
    std::nth_element(own.begin(), own.begin() + std::ssize(own) / 2, own.end());
    distances.push_back(own[own.size() / 2]);
  }
  return distances;
}

}  // namespace

PhotoSpacing SpacingOf(const Capture& capture) {
  PhotoSpacing spacing;
  for (const PhotoStatus& photo : capture.statuses)
    if (photo.status == PhotoState::kUnregistered) spacing.not_placed.push_back(photo.file);
  const size_t count = capture.views.size();
  const std::vector<double> distances = SceneDistances(capture);
  std::vector<double> apart(count * count);
  for (size_t i = 0; i < count; ++i)
    for (size_t j = 0; j < count; ++j) {
      const Camera &a = capture.views[i].camera, &b = capture.views[j].camera;
      const double turned = std::acos(std::clamp(Dot(a.Forward(), b.Forward()), -1.0, 1.0)),
                   far = std::max(1e-12, 0.5 * (distances[i] + distances[j]));
      apart[i * count + j] = std::max(turned, Norm(a.Center() - b.Center()) / far);
    }
  for (size_t i = 0; i < count; ++i)
    for (size_t j = i + 1; j < count; ++j) {
      const double own = apart[i * count + j];
      if (own <= spacing.widest) continue;
      bool between = false;
      for (size_t k = 0; k < count && !between; ++k)
        between = std::max(apart[i * count + k], apart[j * count + k]) < own;
      if (between) continue;
      spacing.widest = own;
      spacing.before = capture.views[i].file;
      spacing.after = capture.views[j].file;
    }
  return spacing;
}

}  // namespace regrade
