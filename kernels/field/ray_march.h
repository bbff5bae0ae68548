// Sample positions along a ray: the box interval, and positions t_i = t_0 + i * step.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/base/vec.h"
#include "kernels/field/march_options.h"
#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"

namespace regrade {

inline constexpr int64_t kMaxSteps = 1 << 20;

// A ray in grid coordinates, clipped to the box. Lengths along it are in voxels.
template <typename T>
struct GridRay {
  Vec3<T> origin, direction;  // grid; direction has unit length
  T world_per_voxel = 0;      // world length of one unit along the ray
  T t_begin = 0;
  int64_t num_steps = 0;  // 0: the ray misses the box or is invalid (zero or non-finite)

  HD Vec3<T> At(T t) const { return origin + direction * t; }
};

// Slab test with half-open faces [lo, hi): a ray parallel to a slab and outside it misses;
// parallel and inside ignores that slab (svox2 counts the former as inside and clamps its
// samples to the face, which is not reproduced here).
template <typename T>
HD REGRADE_ALWAYS_INLINE GridRay<T> ClipToGrid(const GridFrame& frame, const RayT<T>& ray,
                                               T near_clip, T step) {
  using std::isfinite;
  GridRay<T> result;
  if (!AllFinite(ray.origin) || !AllFinite(ray.direction)) return result;
  const Vec3f scale = frame.Scale(), offset = frame.Offset();
  Vec3<T> direction;
  for (int a = 0; a < 3; ++a) {
    result.origin[a] = ray.origin[a] * T(scale[a]) + T(offset[a]);
    direction[a] = ray.direction[a] * T(scale[a]);
  }
  const T voxels_per_world = Norm(direction);
  if (!(voxels_per_world > 0) || !isfinite(voxels_per_world)) return result;
  result.direction = direction / voxels_per_world;
  result.world_per_voxel = 1 / voxels_per_world;

  T begin = near_clip > 0 ? near_clip * voxels_per_world : T(0);
  T end = T(3.4e38);
  for (int a = 0; a < 3; ++a) {
    const T lo = T(-0.5), hi = T(frame.resolution[a]) - T(0.5);
    if (result.direction[a] == 0) {
      if (!(result.origin[a] >= lo && result.origin[a] < hi)) return result;
      continue;
    }
    const T inverse = 1 / result.direction[a];
    T t0 = (lo - result.origin[a]) * inverse, t1 = (hi - result.origin[a]) * inverse;
    if (t0 > t1) {
      const T swap = t0;
      t0 = t1, t1 = swap;
    }
    // 1 + 2 gamma(3) (pbrt-v4, Sec. 6.8.2): a rounding error must not lose a grazing hit.
    t1 *= 1 + T(2) * T(3) * (sizeof(T) == 4 ? T(5.97e-8) : T(1.12e-16));
    if (t0 > begin) begin = t0;
    if (t1 < end) end = t1;
  }
  if (!(end > begin)) return result;
  const T steps = std::ceil((end - begin) / step);
  result.t_begin = begin;
  result.num_steps = steps < T(kMaxSteps) ? static_cast<int64_t>(steps) : kMaxSteps;
  return result;
}

}  // namespace regrade
