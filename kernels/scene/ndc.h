// Normalised device coordinates: the space of forward-facing captures, which maps everything
// from a near plane to infinity into a box.
//
// EQ(ndc), Mildenhall et al. 2020, appendix C, with z forward and near plane z = 1: a point (x,
// y, z) goes to
//   (a x / z, b y / z, 1 - 2 / z),   a = 2 f_x / W, b = 2 f_y / H,
// a ray's origin is first moved to z = 1, and its direction (a (dx/dz - ox/oz), b (dy/dz -
// oy/oz), 2 / oz) is normalised, as in svox2 (NeRF does not). A ray that does not run forward
// has no image in NDC: its direction becomes 0, and the march skips it.
#pragma once

#include "kernels/base/vec.h"

namespace regrade {

struct NdcSpace {
  double a = 0, b = 0;  // 2 f_x / W, 2 f_y / H; 0: the space is off
  HD bool on() const { return a > 0; }
};

template <typename T>
HD void NdcRay(const NdcSpace& space, Vec3<T>* origin, Vec3<T>* direction) {
  const T a = T(space.a), b = T(space.b);
  const Vec3<T> d = *direction;
  if (!(d.z > T(1e-6))) {
    *direction = {};
    return;
  }
  const T t = (T(1) - origin->z) / d.z;
  const T x = origin->x + t * d.x, y = origin->y + t * d.y;
  *origin = {a * x, b * y, T(-1)};
  *direction = Normalized(Vec3<T>{a * (d.x / d.z - x), b * (d.y / d.z - y), T(2)});
}

// Height over width, in NDC, of an extent that is a square in an image with square pixels.
HD inline float VoxelAspect(const NdcSpace& space) {
  return space.on() ? static_cast<float>(space.b / space.a) : 1.0f;
}

// z < 1 in NDC; z = 1 is at infinity.
template <typename T>
HD Vec3<T> WorldFromNdc(const NdcSpace& space, const Vec3<T>& p) {
  const T z = T(2) / (T(1) - p.z);
  return {p.x * z / T(space.a), p.y * z / T(space.b), z};
}

}  // namespace regrade
