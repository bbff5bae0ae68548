#include "reconstruct/scene/scene_checks.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/base/quantile.h"
#include "reconstruct/scene/lens_fold.h"

namespace regrade {
namespace {

// The number of pairs grows with the square of a track's length; this many evenly chosen views
// approximate the largest angle well.
constexpr size_t kViewsOfATrack = 32;
// Focal length over the longer side: the limits of COLMAP's mapper, 157 to 6 degrees.
constexpr double kLeastFocal = 0.1, kMostFocal = 10;

double LargestAngle(const Vec3d& point, const std::vector<int32_t>& views,
                    const std::vector<Vec3d>& centers) {
  const size_t used = std::min(views.size(), kViewsOfATrack);
  std::vector<Vec3d> rays(used);
  for (size_t i = 0; i < used; ++i)
    rays[i] = point - centers[views[used < 2 ? 0 : i * (views.size() - 1) / (used - 1)]];
  double largest = 0;
  for (size_t i = 0; i < used; ++i)
    for (size_t j = i + 1; j < used; ++j)
      // atan2 is accurate for small angles; acos of the scalar product is not.
      largest =
          std::max(largest, std::atan2(Norm(Cross(rays[i], rays[j])), Dot(rays[i], rays[j])));
  return largest;
}

std::vector<Vec3d> Centers(const Capture& capture) {
  std::vector<Vec3d> centers;
  for (const CaptureView& view : capture.views) centers.push_back(view.camera.Center());
  return centers;
}

std::string Rounded(double value, int digits) { return Format("%.*f", digits, value); }

}  // namespace

std::vector<double> TriangulationAngles(const Capture& capture) {
  const std::vector<Vec3d> centers = Centers(capture);
  std::vector<double> angles;
  for (const ScenePoint& point : capture.points)
    angles.push_back(LargestAngle(point.position, point.views, centers));
  return angles;
}

double MedianTriangulationAngle(const Capture& capture) {
  return Median(TriangulationAngles(capture));
}

Capture WithParallax(const Capture& capture, double least_deg) {
  constexpr size_t kFewest = 50;
  const std::vector<double> angles = TriangulationAngles(capture);
  Capture sure = capture;
  sure.points.clear();
  for (size_t i = 0; i < angles.size(); ++i)
    if (angles[i] >= least_deg * M_PI / 180) sure.points.push_back(capture.points[i]);
  return sure.points.size() < std::max(kFewest, capture.points.size() / 10) ? capture : sure;
}

Vec3d PointExtents(const Capture& capture) {
  if (capture.points.size() < 10) return {};
  Vec3d median;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const ScenePoint& point : capture.points) values.push_back(point.position[axis]);
    median[axis] = Median(std::move(values));
  }
  std::vector<Vec3d> offsets;
  for (const ScenePoint& point : capture.points) offsets.push_back(point.position - median);
  const size_t kept = offsets.size() * 9 / 10;
  std::nth_element(offsets.begin(), offsets.begin() + static_cast<ptrdiff_t>(kept),
                   offsets.end(),
                   [](const Vec3d& a, const Vec3d& b) { return Dot(a, a) < Dot(b, b); });
  offsets.resize(kept);

  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Vec3d& offset : offsets) mean += Eigen::Vector3d(offset.x, offset.y, offset.z);
  mean /= static_cast<double>(kept);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Vec3d& offset : offsets) {
    const Eigen::Vector3d x = Eigen::Vector3d(offset.x, offset.y, offset.z) - mean;
    covariance += x * x.transpose();
  }
  covariance /= static_cast<double>(kept);
  const Eigen::Vector3d variances =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance, Eigen::EigenvaluesOnly)
          .eigenvalues()
          .cwiseMax(0);
  return {std::sqrt(variances[2]), std::sqrt(variances[1]), std::sqrt(variances[0])};
}

double WorstPixelAspect(const Capture& capture) {
  double worst = 1;
  for (const CaptureView& view : capture.views) {
    const double aspect = view.camera.fx / view.camera.fy;
    if (std::abs(std::log(aspect)) > std::abs(std::log(worst))) worst = aspect;
  }
  return worst;
}

double LargestDistance(const std::vector<Vec3d>& points) {
  double largest = 0;
  for (size_t i = 0; i < points.size(); ++i)
    for (size_t j = 0; j < i; ++j) largest = std::max(largest, Norm(points[i] - points[j]));
  return largest;
}

std::string ImplausibleLens(const Capture& capture, double max_pixel_aspect) {
  const double aspect = WorstPixelAspect(capture);
  if (std::max(aspect, 1 / aspect) > max_pixel_aspect)
    return "pixels that are not square (fx / fy = " + Rounded(aspect, 3) + ")";
  const Camera* last = nullptr;
  for (const CaptureView& view : capture.views) {
    if (last != nullptr && last->SameIntrinsics(view.camera)) continue;
    last = &view.camera;
    const double focal = std::min(last->fx, last->fy) / std::max(last->width, last->height);
    if (!(focal > kLeastFocal && focal < kMostFocal))
      return "a focal length of " + Rounded(focal, 2) + " times the picture's longer side";
    if (FoldRadius(*last) > 0) return "a distortion that folds the picture over";
  }
  return "";
}

SceneAssessment AssessScene(const Capture& capture, const SceneLimits& limits) {
  SceneAssessment assessment;
  const auto refuse = [&](const std::string& why, const std::string& remedy) {
    assessment.refusal = why;
    assessment.remedy = remedy;
    return assessment;
  };
  const int views = static_cast<int>(capture.views.size());
  const double angle_deg = MedianTriangulationAngle(capture) * 180 / M_PI;
  if (capture.points.empty())
    return refuse("no point of the scene was found in two photos",
                  "take sharper photos of something with texture");
  if (angle_deg < limits.min_triangulation_angle_deg)
    return refuse(
        "the photos were taken from nearly one place: half of the points are seen under less "
        "than " +
            Rounded(angle_deg, 2) +
            " degrees (needed: " + Rounded(limits.min_triangulation_angle_deg, 1) + ")",
        "a camera that only turns shows no depth: step sideways between photos");
  assessment.lens = ImplausibleLens(capture, limits.max_pixel_aspect);
  if (!assessment.lens.empty())
    return refuse(
        "the estimated camera has " + assessment.lens + ", so its geometry is unreliable",
        "the photos do not determine the lens: take some from further to the sides "
        "and at other distances, all at one zoom setting; do not crop or stretch "
        "them, and keep their EXIF data, which has the focal length");
  if (views < limits.min_views)
    return refuse(
        Concat("only ", views, " photos could be registered, and a scene needs at least ",
               limits.min_views),
        "take more photos that overlap by two thirds; 20 to 60 are a good number");
  const Vec3d extents = PointExtents(capture);
  if (extents.y > 0 && extents.z < limits.min_thickness * extents.y)
    assessment.notes.push_back(
        "the points lie nearly in one plane (thickness " +
        Rounded(100 * extents.z / extents.y, 1) +
        " % of its width), so the camera's focal length and the scene's depth are uncertain; "
        "photos from the sides help");
  return assessment;
}

}  // namespace regrade
