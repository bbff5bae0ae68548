#include "reconstruct/scene/given_poses.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/base/quantile.h"
#include "reconstruct/scene/lens_fold.h"
#include "reconstruct/scene/scene_checks.h"

namespace regrade {
namespace {

constexpr double kMostPoints = 0.9;  // quantile of their angles
constexpr double kRounding = 1e-8;   // of the cameras' coordinates
constexpr size_t kFewestPoints = 50;

// The largest angle, in radians, that the cameras' baseline has at the scene, or at nine tenths
// of its points; negative if the scene's distance is unknown.
double Parallax(const Capture& capture, double extent) {
  if (capture.points.size() >= kFewestPoints)
    return Quantile(TriangulationAngles(capture), kMostPoints);
  if (capture.nearest_depth > 0) return std::atan(extent / capture.nearest_depth);
  return -1;
}

}  // namespace

void RequireSoundPoses(const Capture& capture, const std::string& poses) {
  const Camera* last = nullptr;
  for (const CaptureView& view : capture.views) {
    if (last != nullptr && last->SameIntrinsics(view.camera)) continue;
    last = &view.camera;
    if (const double fold = FoldRadius(*last); fold > 0)
      throw SceneError(
          Format("the lens of its camera folds the picture over: farther than %.0f px from the "
                 "principal point two rays have one image point, and the picture's corner is "
                 "%.0f px away",
                 fold,
                 std::hypot(std::max(last->cx, last->width - last->cx),
                            std::max(last->cy, last->height - last->cy))),
          view.file, "correct the distortion coefficients of " + poses);
  }
  std::vector<Vec3d> centers;
  double farthest = 0;
  for (const CaptureView& view : capture.views) {
    centers.push_back(view.camera.Center());
    farthest = std::max(farthest, Norm(centers.back()));
  }
  const double extent = LargestDistance(centers);
  const double parallax_deg = Parallax(capture, extent) * 180 / M_PI;
  const bool one_place = extent <= kRounding * farthest;
  if (!one_place && !(parallax_deg >= 0 && parallax_deg < kNoParallaxDeg)) return;
  const std::string why =
      one_place || parallax_deg < 0
          ? std::string("all cameras are at one place")
          : Format(
                "from the cameras' places nearly nothing shifts: the scene is seen under "
                "less than %.2g degrees (needed: %g)",
                parallax_deg, kNoParallaxDeg);
  throw SceneError(why + ", which shows no depth", poses,
                   "check the cameras' positions; photos must be taken from different places");
}

}  // namespace regrade
