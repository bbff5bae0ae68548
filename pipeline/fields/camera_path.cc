#include "pipeline/fields/camera_path.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "kernels/base/error.h"
#include "kernels/scene/common_camera.h"
#include "kernels/scene/facing.h"

namespace regrade {
namespace {

// The point nearest to all optical axes in the least squares sense; a weak term towards a point
// in front of the cameras decides where the axes are parallel.
Vec3d LookAtPoint(const std::vector<Camera>& cameras, const Vec3d& center) {
  double spread = 0;
  Vec3d heading{};
  for (const Camera& camera : cameras) {
    spread += Norm(camera.Center() - center);
    heading += camera.Forward();
  }
  const double n = static_cast<double>(cameras.size());
  const Vec3d ahead = center + heading / n * std::max(3 * spread / n, 1e-3);
  constexpr double kPull = 1e-3;
  Mat3d a;
  Vec3d b = ahead * (kPull * n);
  for (int i = 0; i < 3; ++i) a(i, i) = kPull * n;
  for (const Camera& camera : cameras) {
    const Vec3d d = camera.Forward(), c = camera.Center();
    b += c - d * Dot(d, c);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) a(i, j) += (i == j) - d[i] * d[j];
  }
  Vec3d x;  // Cramer's rule: the matrix is positive definite
  const double determinant = a.Determinant();
  for (int k = 0; k < 3; ++k) {
    Mat3d replaced = a;
    for (int i = 0; i < 3; ++i) replaced(i, k) = b[i];
    x[k] = replaced.Determinant() / determinant;
  }
  return x;
}

Camera LookingAlong(const Camera& model, const Vec3d& center, const Vec3d& ahead,
                    const Vec3d& up) {
  const Vec3d forward = Normalized(ahead);
  Vec3d right = Cross(forward, up);
  if (Norm(right) < 1e-9) right = Cross(forward, Vec3d{1, 0, 0} + up * 0.5);
  right = Normalized(right);
  Camera camera = model;
  camera.camera_from_world = Facing(center, forward, right);
  return camera;
}

// Dissimilarity of two views: their distance, and as much again for a turn of one radian.
double Jump(const Camera& a, const Camera& b, double unit) {
  const double turn = std::acos(std::clamp(Dot(a.Forward(), b.Forward()), -1.0, 1.0));
  return Norm(a.Center() - b.Center()) / unit + turn;
}

double MeanExtent(const std::vector<Camera>& cameras, const Vec3d& center) {
  double sum = 0;
  for (const Camera& camera : cameras) sum += Norm(camera.Center() - center);
  return std::max(sum / static_cast<double>(cameras.size()), 1e-9);
}

Vec3d MeanCenter(const std::vector<Camera>& cameras) {
  Vec3d sum{};
  for (const Camera& camera : cameras) sum += camera.Center();
  return sum / static_cast<double>(cameras.size());
}

Vec3d MeanUp(const std::vector<Camera>& cameras) {
  Vec3d up{};
  for (const Camera& camera : cameras) up += camera.Up();
  return Norm(up) > 0.1 * static_cast<double>(cameras.size()) ? Normalized(up) : Vec3d{0, 0, 1};
}

// Gaussian means of the photos' positions and orientations along the tour.
std::vector<Camera> SmoothPath(const std::vector<Camera>& cameras,
                               const std::vector<double>& moments, double relative_width) {
  const std::vector<int> order = SmoothOrder(cameras);
  const double unit = MeanExtent(cameras, MeanCenter(cameras));
  std::vector<double> at(order.size(), 0.0);
  for (size_t i = 1; i < order.size(); ++i)
    at[i] = at[i - 1] + Jump(cameras[order[i - 1]], cameras[order[i]], unit);
  const double length = at.back();
  const double width =
      std::max(relative_width * 1.5 * length / static_cast<double>(order.size()), 1e-9);
  const Camera film = CommonCamera(cameras);
  std::vector<Camera> path;
  for (const double moment : moments) {
    const double t = length * EasedWay(moment);
    Vec3d center{}, forward{}, up{};
    double total = 0;
    // Relative to the nearest photo, so that narrow Gaussians do not vanish between photos.
    double nearest = 1e300;
    for (const double place : at) nearest = std::min(nearest, std::abs(place - t) / width);
    for (size_t i = 0; i < order.size(); ++i) {
      const Camera& camera = cameras[order[i]];
      const double z = (at[i] - t) / width;
      const double weight = std::exp(-0.5 * (z * z - nearest * nearest)) + 1e-12;
      center += camera.Center() * weight;
      forward += camera.Forward() * weight;
      up += camera.Up() * weight;
      total += weight;
    }
    if (Norm(forward) < 1e-6 * total) forward = cameras[0].Forward();
    path.push_back(LookingAlong(film, center / total, forward, up / total));
  }
  return path;
}

std::vector<Camera> OrbitPath(const std::vector<Camera>& cameras,
                              const std::vector<double>& moments) {
  const Vec3d up = MeanUp(cameras), center = MeanCenter(cameras);
  const Vec3d target = LookAtPoint(cameras, center);
  double radius = 0, height = 0;
  for (const Camera& camera : cameras) {
    const Vec3d d = camera.Center() - target;
    height += Dot(d, up);
    radius += Norm(d - up * Dot(d, up));
  }
  radius /= static_cast<double>(cameras.size());
  height /= static_cast<double>(cameras.size());
  const Vec3d first = center - target;
  Vec3d across = first - up * Dot(first, up);
  across = Norm(across) > 1e-9 ? Normalized(across) : Normalized(Cross(up, Vec3d{1, 0, 0.3}));
  const Vec3d side = Cross(up, across);
  const Camera film = CommonCamera(cameras);
  std::vector<Camera> path;
  for (const double moment : moments) {
    const double a = 2 * M_PI * moment;
    const Vec3d place =
        target + (across * std::cos(a) + side * std::sin(a)) * radius + up * height;
    path.push_back(LookingAlong(film, place, target - place, up));
  }
  return path;
}

std::vector<Camera> SpiralPath(const std::vector<Camera>& cameras,
                               const std::vector<double>& moments) {
  const Vec3d up = MeanUp(cameras), center = MeanCenter(cameras);
  const Vec3d target = LookAtPoint(cameras, center);
  const Vec3d forward = Normalized(target - center);
  const Vec3d right = Normalized(Cross(forward, up)), down = Cross(forward, right);
  double sway_x = 0, sway_y = 0;
  for (const Camera& camera : cameras) {
    sway_x += std::abs(Dot(camera.Center() - center, right));
    sway_y += std::abs(Dot(camera.Center() - center, down));
  }
  sway_x /= static_cast<double>(cameras.size());
  sway_y /= static_cast<double>(cameras.size());
  const Camera film = CommonCamera(cameras);
  std::vector<Camera> path;
  for (const double moment : moments) {
    const double a = 4 * M_PI * moment;
    const Vec3d place = center + right * (sway_x * std::cos(a)) +
                        down * (sway_y * std::sin(a)) +
                        forward * (0.3 * sway_y * std::sin(0.5 * a));
    path.push_back(LookingAlong(film, place, target - place, up));
  }
  return path;
}

double TourLength(const std::vector<Camera>& cameras, const std::vector<int>& order,
                  double unit) {
  double length = 0;
  for (size_t i = 1; i < order.size(); ++i)
    length += Jump(cameras[order[i - 1]], cameras[order[i]], unit);
  return length;
}

}  // namespace

std::vector<int> SmoothOrder(const std::vector<Camera>& cameras) {
  const size_t n = cameras.size();
  std::vector<int> natural(n);
  std::iota(natural.begin(), natural.end(), 0);
  constexpr size_t kMostToSort = 300;  // 2-opt is cubic at worst
  if (n < 4 || n > kMostToSort) return natural;
  const double unit = MeanExtent(cameras, MeanCenter(cameras));
  const auto jump = [&](int a, int b) { return Jump(cameras[a], cameras[b], unit); };
  std::vector<int> tour = natural;
  for (bool better = true; better;) {
    better = false;
    for (size_t i = 0; i + 1 < n; ++i)
      for (size_t j = i + 1; j < n; ++j) {
        // Reversing tour[i .. j] changes only the links at its two ends.
        double change = 0;
        if (i > 0) change += jump(tour[i - 1], tour[j]) - jump(tour[i - 1], tour[i]);
        if (j + 1 < n) change += jump(tour[i], tour[j + 1]) - jump(tour[j], tour[j + 1]);
        if (change < -1e-9) {
          std::reverse(tour.begin() + static_cast<long>(i),
                       tour.begin() + static_cast<long>(j) + 1);
          better = true;
        }
      }
  }
  // The order of the photos is kept unless it has large jumps.
  return TourLength(cameras, tour, unit) < 0.8 * TourLength(cameras, natural, unit) ? tour
                                                                                    : natural;
}

double EasedWay(double time) {
  // The integral of a trapezium of speeds; its area is 1 - kEasing.
  const auto rising = [](double t) { return 0.5 * t * t / kEasing; };
  double way;
  if (time < kEasing)
    way = rising(time);
  else if (time > 1 - kEasing)
    way = 1 - kEasing - rising(1 - time);
  else
    way = time - 0.5 * kEasing;
  return std::clamp(way / (1 - kEasing), 0.0, 1.0);
}

std::vector<Camera> MakeCameraPath(const std::vector<Camera>& cameras,
                                   const PathOptions& options,
                                   const std::vector<double>& moments, double width) {
  REGRADE_CHECK(!cameras.empty());
  if (options.path == "views") return WithCommonIntrinsics(cameras);
  if (options.path == "smooth") return SmoothPath(cameras, moments, width);
  if (options.path == "orbit") return OrbitPath(cameras, moments);
  if (options.path == "spiral") return SpiralPath(cameras, moments);
  throw UsageError("'" + options.path + "' is not allowed", "--path",
                   "give one of smooth, views, orbit, spiral");
}

}  // namespace regrade
