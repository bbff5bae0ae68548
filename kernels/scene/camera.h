// A calibrated camera: intrinsics with lens distortion, and camera_from_world.
//
// Frames: OpenCV axes (x right, y down, z forward). Pixel (column x, row y) has its centre at
// (x + 0.5, y + 0.5). All angles in radians, lengths in world units.
#pragma once

#include <array>

#include "kernels/base/vec.h"
#include "kernels/scene/ndc.h"

namespace regrade {

template <typename T>
struct RayT {
  Vec3<T> origin;     // world
  Vec3<T> direction;  // world, unit length
};
using Ray = RayT<float>;

enum class LensModel {
  kPinhole,     // no coefficients
  kOpenCv,      // k1 k2 p1 p2 (COLMAP OPENCV; RADIAL and SIMPLE_RADIAL are special cases)
  kFullOpenCv,  // k1 k2 p1 p2 k3 k4 k5 k6
  kFisheye,     // k1 k2 k3 k4 (COLMAP OPENCV_FISHEYE)
};

// x_target = rotation * x_source + translation.
struct RigidTransform {
  Mat3d rotation;
  Vec3d translation;

  Vec3d operator*(const Vec3d& x) const { return rotation * x + translation; }
  RigidTransform Inverse() const {
    const Mat3d transposed = rotation.Transposed();
    return {transposed, -(transposed * translation)};
  }
  RigidTransform operator*(const RigidTransform& o) const {
    return {rotation * o.rotation, rotation * o.translation + translation};
  }
};

// x_target = scale * rotation * x_source + translation.
struct Similarity {
  double scale = 1.0;
  Mat3d rotation;
  Vec3d translation;

  Vec3d operator*(const Vec3d& x) const { return scale * (rotation * x) + translation; }
};

struct Camera {
  int width = 0;  // pixels
  int height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;  // pixels
  LensModel lens = LensModel::kPinhole;
  std::array<double, 8> distortion{};  // meaning by `lens`; unused entries are 0
  RigidTransform camera_from_world;
  NdcSpace ndc;  // if on, pixel rays are in NDC

  Vec3d Center() const { return camera_from_world.Inverse().translation; }
  // World directions of the optical axis (z) and of "up" in the picture (-y).
  Vec3d Forward() const { return camera_from_world.rotation.row[2]; }
  Vec3d Up() const { return -camera_from_world.rotation.row[1]; }

  // Direction in camera coordinates of image point (u, v) in pixels, with z = 1 (unit length
  // for a fisheye lens). The distortion is inverted by Newton steps to 1e-10; beyond the point
  // where it folds over, the last monotone point is used.
  Vec3d CameraRay(double u, double v) const;
  // World ray through (u, v) pixels. Its direction is unit to double precision before rounding.
  RayT<double> WorldRay(double u, double v) const;
  // Through (u, v) pixels in the field's space, the world or NDC; and through the centre of
  // pixel (x, y).
  Ray FieldRay(double u, double v) const;
  Ray PixelRay(int x, int y) const { return FieldRay(x + 0.5, y + 0.5); }

  // Image point of a world point; false if it is behind the camera. Depth is z in the camera
  // frame.
  bool Project(const Vec3d& point_world, double* u, double* v, double* depth = nullptr) const;

  // The same camera for an image resampled to width x height.
  Camera Resized(int new_width, int new_height) const;
  // The same view through a lens without distortion.
  Camera Undistorted() const;
  // The same view in a world transformed by `target_from_world` (depths scale with its scale).
  Camera Transformed(const Similarity& target_from_world) const;

  // True if size, focal lengths, principal point and distortion are the same to the bit.
  bool SameIntrinsics(const Camera& other) const;

  // The largest displacement of an image corner by distortion, in pixels.
  double MaxCornerDistortion() const;
};

}  // namespace regrade
