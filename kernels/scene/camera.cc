#include "kernels/scene/camera.h"

#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

// Image-plane point (x, y, z = 1) to distorted normalised coordinates.
void Distort(const Camera& camera, double x, double y, double* xd, double* yd) {
  const auto& k = camera.distortion;
  const double r2 = x * x + y * y;
  switch (camera.lens) {
    case LensModel::kPinhole:
      *xd = x, *yd = y;
      return;
    case LensModel::kOpenCv:
    case LensModel::kFullOpenCv: {
      double radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
      radial /= 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
      *xd = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x);
      *yd = y * radial + 2 * k[3] * x * y + k[2] * (r2 + 2 * y * y);
      return;
    }
    case LensModel::kFisheye: {
      const double r = std::sqrt(r2);
      if (r < 1e-12) {
        *xd = x, *yd = y;
        return;
      }
      const double a = std::atan(r), a2 = a * a;
      const double ad = a * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))));
      *xd = x * ad / r, *yd = y * ad / r;
      return;
    }
  }
}

// Angle from the axis whose fisheye image radius is `radius`: Newton on the odd polynomial,
// kept in [0, pi).
double FisheyeAngle(const std::array<double, 8>& k, double radius) {
  double a = radius;
  for (int i = 0; i < 20; ++i) {
    const double a2 = a * a;
    const double value = a * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3])))) - radius;
    const double slope =
        1 + a2 * (3 * k[0] + a2 * (5 * k[1] + a2 * (7 * k[2] + a2 * 9 * k[3])));
    if (slope < 1e-6) break;
    const double step = value / slope;
    a = std::clamp(a - step, 0.0, M_PI - 1e-6);
    if (std::abs(step) < 1e-12) break;
  }
  return a;
}

}  // namespace

Vec3d Camera::CameraRay(double u, double v) const {
  const double xd = (u - cx) / fx, yd = (v - cy) / fy;
  if (lens == LensModel::kPinhole) return {xd, yd, 1.0};
  if (lens == LensModel::kFisheye) {
    const double r = std::hypot(xd, yd);
    if (r < 1e-12) return {xd, yd, 1.0};
    const double a = FisheyeAngle(distortion, r);
    return {std::sin(a) * xd / r, std::sin(a) * yd / r, std::cos(a)};
  }
  // Newton on the 2x2 system, Jacobian by central differences (the model is smooth and the step
  // well scaled).
  double x = xd, y = yd;
  for (int i = 0; i < 50; ++i) {
    double fx0, fy0;
    Distort(*this, x, y, &fx0, &fy0);
    const double ex = fx0 - xd, ey = fy0 - yd;
    if (std::abs(ex) + std::abs(ey) < 1e-13) break;
    const double h = 1e-6;
    double ax, ay, bx, by;
    Distort(*this, x + h, y, &ax, &ay);
    Distort(*this, x - h, y, &bx, &by);
    const double j00 = (ax - bx) / (2 * h), j10 = (ay - by) / (2 * h);
    Distort(*this, x, y + h, &ax, &ay);
    Distort(*this, x, y - h, &bx, &by);
    const double j01 = (ax - bx) / (2 * h), j11 = (ay - by) / (2 * h);
    const double det = j00 * j11 - j01 * j10;
    if (!(det > 1e-3)) break;  // the distortion folds over beyond this point
    x -= (j11 * ex - j01 * ey) / det;
    y -= (-j10 * ex + j00 * ey) / det;
  }
  return {x, y, 1.0};
}

RayT<double> Camera::WorldRay(double u, double v) const {
  const Mat3d world_from_camera = camera_from_world.rotation.Transposed();
  return {Center(), Normalized(world_from_camera * CameraRay(u, v))};
}

Ray Camera::FieldRay(double u, double v) const {
  RayT<double> ray = WorldRay(u, v);
  if (ndc.on()) NdcRay(ndc, &ray.origin, &ray.direction);
  return {ray.origin.Cast<float>(), ray.direction.Cast<float>()};
}

bool Camera::Project(const Vec3d& point_world, double* u, double* v, double* depth) const {
  const Vec3d p = camera_from_world * point_world;
  if (depth != nullptr) *depth = p.z;
  if (!(p.z > 0)) return false;
  double xd, yd;
  Distort(*this, p.x / p.z, p.y / p.z, &xd, &yd);
  *u = fx * xd + cx;
  *v = fy * yd + cy;
  return true;
}

bool Camera::SameIntrinsics(const Camera& other) const {
  return width == other.width && height == other.height && fx == other.fx && fy == other.fy &&
         cx == other.cx && cy == other.cy && lens == other.lens &&
         distortion == other.distortion;
}

Camera Camera::Resized(int new_width, int new_height) const {
  Camera result = *this;
  const double sx = static_cast<double>(new_width) / width;
  const double sy = static_cast<double>(new_height) / height;
  result.width = new_width;
  result.height = new_height;
  result.fx *= sx, result.cx *= sx;
  result.fy *= sy, result.cy *= sy;
  return result;
}

Camera Camera::Undistorted() const {
  Camera result = *this;
  result.lens = LensModel::kPinhole;
  result.distortion = {};
  return result;
}

Camera Camera::Transformed(const Similarity& target_from_world) const {
  Camera result = *this;
  const Vec3d center = target_from_world * Center();
  result.camera_from_world.rotation =
      camera_from_world.rotation * target_from_world.rotation.Transposed();
  result.camera_from_world.translation = -(result.camera_from_world.rotation * center);
  return result;
}

double Camera::MaxCornerDistortion() const {
  if (lens == LensModel::kPinhole) return 0;
  double most = 0;
  for (const double u : {0.0, static_cast<double>(width)})
    for (const double v : {0.0, static_cast<double>(height)}) {
      const double x = (u - cx) / fx, y = (v - cy) / fy;
      double xd = x, yd = y;
      Distort(*this, x, y, &xd, &yd);
      most = std::max(most, std::hypot((xd - x) * fx, (yd - y) * fy));
    }
  return most;
}

}  // namespace regrade
