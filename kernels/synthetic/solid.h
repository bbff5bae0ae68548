// The shapes of synthetic scenes and their intersections with rays, in double precision.
#pragma once

#include <vector>

#include "kernels/base/vec.h"
#include "kernels/scene/camera.h"
#include "kernels/synthetic/procedural_texture.h"

namespace regrade {

enum class Shape {
  kSphere,    // half.x: radius
  kBox,       // half: half of each side
  kCylinder,  // upright, with lids; half.x: radius, half.z: half of the height
  kBackdrop,  // an upright cylinder's wall without thickness, the part with local y > half.y;
              // half.x: radius, half.z: half of the height
};

struct Solid {
  Shape shape = Shape::kSphere;
  Vec3d center;                     // world
  Vec3d half;                       // world units, meaning by `shape`
  double cos_yaw = 1, sin_yaw = 0;  // rotation about the world's z axis
  Paint paint;
  double gloss = 0;          // strength of the highlight, where highlights are simulated
  bool casts_shadow = true;  // false for walls: the light comes from outside
};

struct Hit {
  double distance = 0;  // along the unit direction, world units
  Vec3d point;          // world
  Vec3d normal;         // world, unit, towards the ray's origin
  double u = 0, v = 0;  // the paint's coordinates, world units
  int solid = -1;       // index; -1: no hit
};

// Along the ray to the solid's nearest surface farther than `min_distance`; infinity if there
// is none.
double HitDistance(const Solid& solid, const RayT<double>& ray, double min_distance);

// The hit of a solid at that distance; no hit if `index` is -1.
Hit HitOf(const std::vector<Solid>& solids, int index, const RayT<double>& ray,
          double distance);

// The nearest solid in front of the ray's origin, farther than `min_distance`.
Hit FindHit(const std::vector<Solid>& solids, const RayT<double>& ray, double min_distance);

// True if a shadow-casting solid lies ahead on the ray.
bool IsShadowed(const std::vector<Solid>& solids, const RayT<double>& ray, double min_distance);

// How far from its centre a small solid that casts a shadow dims the sky; 0 of others.
double ContactReach(const Solid& solid);

}  // namespace regrade
