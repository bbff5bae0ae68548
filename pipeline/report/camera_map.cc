#include "pipeline/report/camera_map.h"

#include <algorithm>
#include <cmath>

#include "pipeline/report/html_text.h"

namespace regrade {
namespace {

constexpr size_t kMostPoints = 1500;
constexpr double kSide = 560, kMargin = 24;
constexpr double kFarPoints = 0.05;  // fraction of the points at each end that may be cropped

Vec3d Unit(const Vec3d& v) {
  const double length = std::sqrt(Dot(v, v));
  return length > 0 ? v * (1 / length) : v;
}

// Directions of the map's axes in the world: right and up on the page.
struct Page {
  Vec3d right, up;
};

// Any unit vector across `axis`.
Vec3d Across(const Vec3d& axis) {
  const Vec3d other = std::abs(axis.x) < 0.7 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  return Unit(Cross(axis, other));
}

Page PageOf(const Capture& capture) {
  Vec3d above{}, look{};
  for (const CaptureView& view : capture.views) {
    above = above + view.camera.Up();
    look = look + view.camera.Forward();
  }
  // Cameras around an object, above and below it, may have no common up vector.
  const double some = 0.1 * static_cast<double>(capture.views.size());
  above = std::sqrt(Dot(above, above)) < some ? capture.views[0].camera.Up() : Unit(above);
  look = look - above * Dot(look, above);
  const Vec3d up = std::sqrt(Dot(look, look)) < some ? Across(above) : Unit(look);
  return {Cross(up, above), up};
}

// The range of `values` without the fraction `outside` at each end.
std::pair<double, double> Range(std::vector<double> values, double outside) {
  std::sort(values.begin(), values.end());
  const auto at = [&](double fraction) {
    return values[static_cast<size_t>(fraction * static_cast<double>(values.size() - 1))];
  };
  return {at(outside), at(1 - outside)};
}

std::string Coordinates(double x, double y) {
  return FixedNumber(x, 1) + "," + FixedNumber(y, 1);
}

}  // namespace

CameraMap MapCameras(const Capture& capture, int holdout) {
  CameraMap map;
  if (capture.views.empty()) return map;
  const Page page = PageOf(capture);
  const std::vector<bool> held_out = HeldOutViews(capture, holdout);
  for (size_t i = 0; i < capture.views.size(); ++i) {
    const Camera& camera = capture.views[i].camera;
    const Vec3d center = camera.Center(), look = camera.Forward();
    map.cameras.push_back({Dot(center, page.right), Dot(center, page.up), Dot(look, page.right),
                           Dot(look, page.up),
                           camera.fx > 0 ? 0.5 * camera.width / camera.fx : 0.5, held_out[i],
                           capture.views[i].file});
  }
  const size_t step = capture.points.size() / kMostPoints + 1;
  for (size_t i = 0; i < capture.points.size(); i += step) {
    const Vec3d& p = capture.points[i].position;
    map.points.emplace_back(Dot(p, page.right), Dot(p, page.up));
  }
  return map;
}

std::string CameraMapHtml(const CameraMap& map) {
  if (map.cameras.empty()) return "";
  std::vector<double> xs, ys;
  for (const CameraMap::Mark& camera : map.cameras) {
    xs.push_back(camera.x);
    ys.push_back(camera.y);
  }
  auto [left, right] = Range(xs, 0);
  auto [low, high] = Range(ys, 0);
  if (map.points.size() >= 20) {
    xs.clear(), ys.clear();
    for (const auto& [x, y] : map.points) xs.push_back(x), ys.push_back(y);
    const auto across = Range(xs, kFarPoints), along = Range(ys, kFarPoints);
    left = std::min(left, across.first), right = std::max(right, across.second);
    low = std::min(low, along.first), high = std::max(high, along.second);
  }
  const double span = std::max({right - left, high - low, 1e-12});
  if (!std::isfinite(span)) return "";
  const double scale = (kSide - 2 * kMargin) / span;
  const double width = (right - left) * scale + 2 * kMargin,
               height = (high - low) * scale + 2 * kMargin;
  const auto px = [&, from = left](double x) { return kMargin + (x - from) * scale; };
  const auto py = [&, from = low](double y) { return height - kMargin - (y - from) * scale; };

  std::string dots;
  for (const auto& [x, y] : map.points)
    if (px(x) > 0 && px(x) < width && py(y) > 0 && py(y) < height)
      dots += "M" + Coordinates(px(x), py(y)) + "h0";
  std::string marks;
  int held_out = 0;
  for (const CameraMap::Mark& camera : map.cameras) {
    held_out += camera.held_out;
    // A wedge as wide as the field of view, foreshortened where the camera looks up or down.
    constexpr double kLength = 20;
    const double x = px(camera.x), y = py(camera.y);
    const double ax = camera.look_x * kLength, ay = -camera.look_y * kLength;
    const double side = std::min(camera.half_width, 1.5);
    const double flat = std::hypot(camera.look_x, camera.look_y);
    const double sx = flat > 0 ? -ay / flat * side : 0, sy = flat > 0 ? ax / flat * side : 0;
    marks += std::string("<g class=") + (camera.held_out ? "kept" : "cam") + "><path d=\"M" +
             Coordinates(x, y) + "L" + Coordinates(x + ax + sx, y + ay + sy) + "L" +
             Coordinates(x + ax - sx, y + ay - sy) + "z\"/><circle cx=" + FixedNumber(x, 1) +
             " cy=" + FixedNumber(y, 1) + " r=3 /><title>" + EscapeHtml(camera.file) +
             "</title></g>";
  }
  return "<figure class=map><svg role=img aria-label=\"positions of the cameras, seen from "
         "above\" viewBox=\"0 0 " +
         FixedNumber(width, 0) + " " + FixedNumber(height, 0) + "\"><path class=points d=\"" +
         dots + "\"/>" + marks +
         "</svg><figcaption>Seen from above: " + std::to_string(map.cameras.size()) +
         " cameras and their viewing directions" +
         (held_out > 0 ? ", " + std::to_string(held_out) + " of them held out" : "") +
         (map.points.empty() ? "" : "; dots are points of the scene") +
         ".</figcaption></figure>";
}

}  // namespace regrade
