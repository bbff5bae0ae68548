#include "reconstruct/scene/normalize_scene.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/base/quantile.h"

namespace regrade {
namespace {

constexpr size_t kMinPoints = 50;
constexpr double kTail = 0.01;            // fraction of points omitted at each end of an axis
constexpr double kMargin = 0.08;          // of the extent, added on both sides
constexpr double kNearestFraction = 0.6;  // near clip over the distance of the nearest points
// A photo also shows regions without points: its corners get this quantile of its points'
// depths, and the box omits the tail of all photos' corners.
constexpr double kCornerDepth = 0.25;
constexpr double kCornerTail = 0.1;
constexpr size_t kMinPointsOfView = 10;
// Of the half side of a cube around the axes' common point: the cameras' median distance, and
// the near clip without points.
constexpr double kCameraRange = 0.9;
constexpr double kFewPointsNearest = 0.35;
constexpr double kNearPoints = 0.1;    // quantile of the points' distances, for cameras inside
constexpr double kMostNearClip = 0.5;  // half sides

Eigen::Vector3d ToEigen(const Vec3d& v) { return {v.x, v.y, v.z}; }
Vec3d FromEigen(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

// Sums in the order of sorted values, so that re-ordered photos give the same bits (H154).
Vec3d OrderFreeMean(std::vector<Vec3d> values) {
  Vec3d mean;
  for (int a = 0; a < 3; ++a) {
    std::vector<double> axis;
    for (const Vec3d& v : values) axis.push_back(v[a]);
    std::ranges::sort(axis);
    double sum = 0;
    for (const double v : axis) sum += v;
    mean[a] = sum / static_cast<double>(axis.size());
  }
  return mean;
}

// Makes the largest component positive: an eigenvector's sign must not depend on the solver.
Eigen::Vector3d FixSign(Eigen::Vector3d v) {
  Eigen::Index largest;
  v.cwiseAbs().maxCoeff(&largest);
  return v(largest) < 0 ? Eigen::Vector3d(-v) : v;
}

Eigen::Matrix3d Scatter(const std::vector<Vec3d>& positions, const Vec3d& mean) {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Vec3d& p : positions) {
    const Eigen::Vector3d d = ToEigen(p - mean);
    covariance += d * d.transpose();
  }
  return covariance;
}

Mat3d UprightRotation(const std::vector<Vec3d>& centers, const std::vector<Vec3d>& ups,
                      const std::vector<Vec3d>& forwards, std::string* notice) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> scatter(
      Scatter(centers, OrderFreeMean(centers)));
  Eigen::Vector3d up = ToEigen(OrderFreeMean(ups));
  if (up.norm() < 0.1) {
    up = FixSign(scatter.eigenvectors().col(0));
    *notice =
        "the photos disagree about up; the direction in which the cameras moved least is used";
  }
  up.normalize();
  Eigen::Vector3d heading = ToEigen(OrderFreeMean(forwards));
  heading -= up * up.dot(heading);
  if (heading.norm() < 0.1) {
    // Photos in all directions: uses the direction in which the cameras moved most.
    heading = FixSign(scatter.eigenvectors().col(2));
    heading -= up * up.dot(heading);
  }
  if (heading.norm() < 1e-6) heading = up.unitOrthogonal();
  heading.normalize();
  const Eigen::Vector3d right = heading.cross(up);
  Mat3d rotation;
  rotation.row[0] = FromEigen(right);
  rotation.row[1] = FromEigen(heading);
  rotation.row[2] = FromEigen(up);
  return rotation;
}

// The point nearest to all optical axes; regularised, so that parallel axes give the cameras'
// mean.
Vec3d CommonPoint(const std::vector<Vec3d>& centers, const std::vector<Vec3d>& forwards) {
  const Eigen::Vector3d mean = ToEigen(OrderFreeMean(centers));
  Eigen::Matrix3d a = 1e-6 * static_cast<double>(centers.size()) * Eigen::Matrix3d::Identity();
  Eigen::Vector3d b = a * mean;
  for (size_t i = 0; i < centers.size(); ++i) {
    const Eigen::Vector3d d = ToEigen(forwards[i]);
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - d * d.transpose();
    a += across;
    b += across * ToEigen(centers[i]);
  }
  return FromEigen(a.ldlt().solve(b));
}

// The corners of the photos at the depth of their nearer points. Points alone would omit
// regions without texture: a third of a picture of an object in front of a dark room.
std::vector<Vec3d> PhotoCorners(const Capture& capture) {
  std::vector<std::vector<double>> depths(capture.views.size());
  for (const ScenePoint& point : capture.points)
    for (const int32_t view : point.views) {
      const auto v = static_cast<size_t>(view);
      const double depth = (capture.views[v].camera.camera_from_world * point.position).z;
      if (depth > 0) depths[v].push_back(depth);
    }
  std::vector<Vec3d> corners;
  for (size_t v = 0; v < depths.size(); ++v) {
    if (depths[v].size() < kMinPointsOfView) continue;
    const Camera& camera = capture.views[v].camera;
    const double depth = Quantile(depths[v], kCornerDepth);
    for (const double x : {0.0, static_cast<double>(camera.width)})
      for (const double y : {0.0, static_cast<double>(camera.height)}) {
        const Vec3d ray = camera.CameraRay(x, y);
        if (!(ray.z > 0.1)) continue;  // sideways through a fisheye lens
        corners.push_back(camera.camera_from_world.Inverse() * (ray * (depth / ray.z)));
      }
  }
  return corners;
}

// Distances below this are rounding errors of the camera centres, amplified by a matrix of
// condition 1e6.
double RoundingOf(const std::vector<Vec3d>& centers) {
  double farthest = 0;
  for (const Vec3d& c : centers) farthest = std::max(farthest, Norm(c));
  return 1e-8 * farthest;
}

// Centres and directions of all cameras.
struct CameraPoses {
  std::vector<Vec3d> centers, ups, forwards;

  explicit CameraPoses(const Capture& capture) {
    for (const CaptureView& view : capture.views) {
      centers.push_back(view.camera.Center());
      ups.push_back(view.camera.Up());
      forwards.push_back(view.camera.Forward());
    }
  }
};

// The near clip in world units: a fraction of the nearest points' distance; 0 without points.
double NearestDistance(const Capture& capture, const std::vector<Vec3d>& centers) {
  std::vector<double> distances;
  for (const ScenePoint& p : capture.points)
    for (const int32_t view : p.views) distances.push_back(Norm(p.position - centers[view]));
  return distances.empty() ? 0 : kNearestFraction * Quantile(distances, kTail);
}

// The near clip in world units without points: a fraction of the nearest camera's distance to
// the box; 0 for a camera inside.
double NearestToBox(const WorldBox& box, const std::vector<Vec3d>& centers) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Vec3d& c : centers) {
    Vec3d out;
    for (int a = 0; a < 3; ++a) out[a] = std::max({box.low[a] - c[a], 0.0, c[a] - box.high[a]});
    nearest = std::min(nearest, Norm(out));
  }
  return kNearestFraction * nearest;
}

// The extent along an axis of unit length.
void ExtentOf(const WorldBox& box, const Vec3d& axis, double* low, double* high) {
  const Vec3d middle = (box.low + box.high) * 0.5, half = (box.high - box.low) * 0.5;
  double reach = 0;
  for (int a = 0; a < 3; ++a) reach += std::abs(axis[a]) * half[a];
  *low = Dot(axis, middle) - reach;
  *high = Dot(axis, middle) + reach;
}

}  // namespace

NormalizedScene NormalizeScene(const Capture& capture) {
  NormalizedScene result;
  const CameraPoses poses(capture);
  const auto& [centers, ups, forwards] = poses;
  const Mat3d rotation = UprightRotation(centers, ups, forwards, &result.notice);

  // Box and nearest distance in the rotated world.
  Vec3d low, high;
  double nearest = 0;
  if (capture.box) {
    for (int a = 0; a < 3; ++a) ExtentOf(*capture.box, rotation.row[a], &low[a], &high[a]);
    nearest = capture.points.size() >= kMinPoints ? NearestDistance(capture, centers)
                                                  : NearestToBox(*capture.box, centers);
  } else if (capture.points.size() >= kMinPoints) {
    const std::vector<Vec3d> corners = PhotoCorners(capture);
    for (int a = 0; a < 3; ++a) {
      std::vector<double> along;
      for (const ScenePoint& p : capture.points)
        along.push_back(Dot(rotation.row[a], p.position));
      low[a] = Quantile(along, kTail);
      high[a] = Quantile(along, 1 - kTail);
      if (corners.empty()) continue;
      along.clear();
      for (const Vec3d& corner : corners) along.push_back(Dot(rotation.row[a], corner));
      low[a] = std::min(low[a], Quantile(along, kCornerTail));
      high[a] = std::max(high[a], Quantile(along, 1 - kCornerTail));
    }
    nearest = NearestDistance(capture, centers);
  } else {
    const Vec3d common = CommonPoint(centers, forwards);
    std::vector<double> distances;
    for (const Vec3d& c : centers) distances.push_back(Norm(c - common));
    double half = Quantile(distances, 0.5) / kCameraRange;
    std::string notice = "few points: the box is the cube around the cameras' common point";
    if (!(half > RoundingOf(centers))) {
      notice =
          "few points, and the cameras are at one place: the box has the size of the points' "
          "distances, or 1";
      std::vector<double> depths;
      for (const ScenePoint& p : capture.points) depths.push_back(Norm(p.position - common));
      half = depths.empty() ? 1 : Quantile(depths, 0.5);
      if (!(half > RoundingOf(centers))) half = 1;
    }
    result.notice += (result.notice.empty() ? "" : "; ") + notice;
    for (int a = 0; a < 3; ++a) {
      const double middle = Dot(rotation.row[a], common);
      low[a] = middle - half;
      high[a] = middle + half;
    }
    nearest = kFewPointsNearest * half;
  }
  Vec3d middle, half;
  double longest = 0;
  for (int a = 0; a < 3; ++a) {
    middle[a] = 0.5 * (low[a] + high[a]);
    half[a] = (0.5 + kMargin) * (high[a] - low[a]);
    longest = std::max(longest, half[a]);
  }
  if (!(longest > 0)) longest = 1;
  Similarity& s = result.field_from_world;
  s.scale = 1 / longest;
  s.rotation = rotation;
  s.translation = -(s.scale * middle);
  for (int a = 0; a < 3; ++a)  // a flat scene still gets a box with a volume
    result.box.radius[a] = static_cast<float>(std::max(half[a] / longest, 0.05));
  result.box.near_clip = static_cast<float>(nearest * s.scale);
  return result;
}

Surroundings MeasureSurroundings(const Capture& capture, double camera_range) {
  Surroundings result;
  const CameraPoses poses(capture);
  result.center = CommonPoint(poses.centers, poses.forwards);
  std::vector<double> distances, ahead;
  for (size_t i = 0; i < poses.centers.size(); ++i) {
    const Vec3d to_center = result.center - poses.centers[i];
    distances.push_back(Norm(to_center));
    ahead.push_back(Dot(to_center, poses.forwards[i]));
  }
  const double half =
      Quantile(distances, 0.5) / (camera_range > 0 ? camera_range : kCameraRange);
  if (!(half > RoundingOf(poses.centers))) return result;
  result.half = half;
  // Cameras that look outwards surround nothing: the near region extends to the nearer points.
  if (!(camera_range > 0) && Quantile(ahead, 0.5) < 0 && capture.points.size() >= kMinPoints) {
    std::vector<double> out;
    for (const ScenePoint& p : capture.points) out.push_back(Norm(p.position - result.center));
    result.half = std::max(half, Quantile(out, kNearPoints));
  }
  int64_t far = 0, all = 0;
  for (const ScenePoint& p : capture.points) {
    const auto views = std::ssize(p.views);
    all += views;
    if (Norm(p.position - result.center) > kFarSides * result.half) far += views;
  }
  if (capture.points.size() >= kMinPoints && all > 0)
    result.far_fraction = static_cast<double>(far) / static_cast<double>(all);
  return result;
}

NormalizedScene NormalizeSurrounded(const Capture& capture, const Surroundings& surroundings) {
  NormalizedScene result;
  const CameraPoses poses(capture);
  if (!(surroundings.half > 0))
    throw SceneError("the cameras are at one place: they surround no box",
                     "--effects background=on", "leave the choice to auto");
  const Mat3d upright =
      UprightRotation(poses.centers, poses.ups, poses.forwards, &result.notice);
  Similarity& s = result.field_from_world;
  s.scale = 1 / surroundings.half;
  s.rotation.row[0] = upright.row[0];
  s.rotation.row[1] = upright.row[2];
  s.rotation.row[2] = -upright.row[1];
  s.translation = -(s.scale * (s.rotation * surroundings.center));
  const double nearest = capture.points.size() >= kMinPoints
                             ? NearestDistance(capture, poses.centers)
                             : kFewPointsNearest * surroundings.half;
  // A larger near clip would leave nothing of the box.
  result.box.near_clip = static_cast<float>(std::min(nearest * s.scale, kMostNearClip));
  result.box.far_surroundings = true;
  return result;
}

}  // namespace regrade
