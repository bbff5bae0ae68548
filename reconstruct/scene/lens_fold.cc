#include "reconstruct/scene/lens_fold.h"

#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

// Steps from the axis to the border where the lens does not distort, and the most that are
// taken: a wide lens's picture goes on for many times its undistorted width.
constexpr int kSteps = 400, kMostSteps = 20 * kSteps;
constexpr double kBorderRounding = 0.5;  // pixels that a border may be short of

// Of a fisheye lens the distance grows with the ray's angle, else with its tangent.
Vec3d RayAt(const Camera& camera, double along, double x, double y) {
  if (camera.lens != LensModel::kFisheye) return {along * x, along * y, 1};
  return {std::sin(along) * x, std::sin(along) * y, std::cos(along)};
}

// The radius of the fold towards the point (u, v) of the border; 0 if there is none.
double FoldTowards(const Camera& camera, double u, double v) {
  const double xd = (u - camera.cx) / camera.fx, yd = (v - camera.cy) / camera.fy;
  const double border = std::hypot(xd, yd);
  const double border_px = std::hypot(u - camera.cx, v - camera.cy);
  if (!(border_px > kBorderRounding)) return 0;
  double before = 0;
  for (int i = 1; i <= kMostSteps; ++i) {
    const Vec3d ray = RayAt(camera, border * i / kSteps, xd / border, yd / border);
    double there_u = 0, there_v = 0;
    // A fisheye lens's rays from behind its image plane are not projected.
    if (!camera.Project(ray, &there_u, &there_v)) return 0;
    const double here = std::hypot(there_u - camera.cx, there_v - camera.cy);
    if (!(here > before)) return std::max(before, kBorderRounding);
    if (here >= border_px - kBorderRounding) return 0;
    before = here;
  }
  return before;
}

}  // namespace

double FoldRadius(const Camera& camera) {
  if (camera.lens == LensModel::kPinhole) return 0;
  Camera upright = camera;
  upright.camera_from_world = {};
  const double w = camera.width, h = camera.height;
  double least = 0;
  for (const double x : {0.0, w / 2, w})
    for (const double y : {0.0, h / 2, h}) {
      const double fold = FoldTowards(upright, x, y);
      if (fold > 0 && (least == 0 || fold < least)) least = fold;
    }
  return least;
}

}  // namespace regrade
