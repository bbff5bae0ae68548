#include "kernels/synthetic/solid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace regrade {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

Vec3d TurnedBy(const Vec3d& p, double cosine, double sine) {
  return {cosine * p.x - sine * p.y, sine * p.x + cosine * p.y, p.z};
}

// Roots of a t^2 + 2 b t + c; false if there are none.
bool SolveQuadratic(double a, double b, double c, double* t0, double* t1) {
  const double discriminant = b * b - a * c;
  if (!(discriminant > 0) || !(a > 0)) return false;
  const double root = std::sqrt(discriminant);
  const double q = b > 0 ? -b - root : -b + root;  // no cancellation
  *t0 = q / a;
  *t1 = c / q;
  if (*t0 > *t1) std::swap(*t0, *t1);
  return true;
}

double IntersectSphere(const Vec3d& o, const Vec3d& d, double radius, double after) {
  double t0, t1;
  if (!SolveQuadratic(1, Dot(o, d), Dot(o, o) - radius * radius, &t0, &t1)) return kNever;
  return t0 > after ? t0 : t1 > after ? t1 : kNever;
}

double IntersectBox(const Vec3d& o, const Vec3d& d, const Vec3d& half, double after) {
  double enter = -kNever, leave = kNever;
  for (int a = 0; a < 3; ++a) {
    if (d[a] == 0) {
      if (std::abs(o[a]) > half[a]) return kNever;
      continue;
    }
    const double inverse = 1 / d[a];
    double t0 = (-half[a] - o[a]) * inverse, t1 = (half[a] - o[a]) * inverse;
    if (t0 > t1) std::swap(t0, t1);
    enter = std::max(enter, t0);
    leave = std::min(leave, t1);
  }
  if (enter > leave) return kNever;
  return enter > after ? enter : leave > after ? leave : kNever;
}

// The wall of an upright cylinder without its part at local y <= min_y.
double IntersectTube(const Vec3d& o, const Vec3d& d, double radius, double half_height,
                     double min_y, double after) {
  double roots[2];
  if (!SolveQuadratic(d.x * d.x + d.y * d.y, o.x * d.x + o.y * d.y,
                      o.x * o.x + o.y * o.y - radius * radius, &roots[0], &roots[1]))
    return kNever;
  for (const double t : roots)
    if (t > after && std::abs(o.z + t * d.z) <= half_height && o.y + t * d.y > min_y) return t;
  return kNever;
}

double IntersectCylinder(const Vec3d& o, const Vec3d& d, const Vec3d& half, double after) {
  double best = IntersectTube(o, d, half.x, half.z, -kNever, after);
  if (d.z != 0)
    for (const double z : {-half.z, half.z}) {
      const double t = (z - o.z) / d.z;
      const double x = o.x + t * d.x, y = o.y + t * d.y;
      if (t > after && t < best && x * x + y * y <= half.x * half.x) best = t;
    }
  return best;
}

double Intersect(const Solid& solid, const Vec3d& o, const Vec3d& d, double after) {
  switch (solid.shape) {
    case Shape::kSphere:
      return IntersectSphere(o, d, solid.half.x, after);
    case Shape::kBox:
      return IntersectBox(o, d, solid.half, after);
    case Shape::kCylinder:
      return IntersectCylinder(o, d, solid.half, after);
    case Shape::kBackdrop:
      return IntersectTube(o, d, solid.half.x, solid.half.z, solid.half.y, after);
  }
  return kNever;
}

// A quick rejection test: true if the ray's line misses the solid.
inline bool Misses(const Solid& solid, const RayT<double>& ray) {
  if (solid.shape == Shape::kBackdrop) return false;
  const Vec3d offset = ray.origin - solid.center;
  const double along = Dot(offset, ray.direction);
  return Dot(offset, offset) - along * along > Dot(solid.half, solid.half) * (1 + 1e-9);
}

// The ray in the solid's frame.
void ToLocal(const Solid& solid, const RayT<double>& ray, Vec3d* o, Vec3d* d) {
  *o = TurnedBy(ray.origin - solid.center, solid.cos_yaw, -solid.sin_yaw);
  *d = TurnedBy(ray.direction, solid.cos_yaw, -solid.sin_yaw);
}

// Outward normal and paint coordinates at local point p.
void SetSurface(const Solid& solid, const Vec3d& p, Vec3d* normal, double* u, double* v) {
  const Vec3d& half = solid.half;
  if (solid.shape == Shape::kSphere) {
    *normal = p / half.x;
    // Lambert's equal-area map seen from the top: its only pole is the hidden lowest point.
    const double stretch = std::sqrt(2 / std::max(1e-6, 1 + normal->z));
    *u = p.x * stretch, *v = p.y * stretch;
    return;
  }
  if (solid.shape == Shape::kBox) {
    int axis = 0;
    double most = -kNever;
    for (int a = 0; a < 3; ++a) {
      const double outside = std::abs(p[a]) - half[a];
      if (outside > most) most = outside, axis = a;
    }
    *normal = {};
    (*normal)[axis] = p[axis] > 0 ? 1 : -1;
    // Sides unfold into a strip; each face has another part of the paint.
    const double shift = 17.0 * axis + (p[axis] > 0 ? 7.0 : 0.0);
    *u = (axis == 0 ? p.y : p.x) + shift;
    *v = axis == 2 ? p.y : p.z;
    return;
  }
  const bool lid = solid.shape == Shape::kCylinder && std::abs(p.z) > half.z * (1 - 1e-9);
  if (lid) {
    *normal = {0, 0, p.z > 0 ? 1.0 : -1.0};
    *u = p.x + 23, *v = p.y;
    return;
  }
  *normal = {p.x / half.x, p.y / half.x, 0};
  // The seam of a pot is at its back, that of a backdrop in the removed part.
  *u =
      half.x * (solid.shape == Shape::kBackdrop ? std::atan2(p.x, p.y) : std::atan2(p.x, -p.y));
  *v = p.z;
}

}  // namespace

double HitDistance(const Solid& solid, const RayT<double>& ray, double min_distance) {
  if (Misses(solid, ray)) return kNever;
  Vec3d o, d;
  ToLocal(solid, ray, &o, &d);
  return Intersect(solid, o, d, min_distance);
}

Hit HitOf(const std::vector<Solid>& solids, int index, const RayT<double>& ray,
          double distance) {
  Hit hit;
  hit.distance = distance;
  hit.solid = index;
  if (index < 0) return hit;
  const Solid& solid = solids[index];
  Vec3d o, d, normal;
  ToLocal(solid, ray, &o, &d);
  hit.point = ray.origin + ray.direction * distance;
  SetSurface(solid, o + d * distance, &normal, &hit.u, &hit.v);
  hit.normal = TurnedBy(normal, solid.cos_yaw, solid.sin_yaw);
  if (Dot(hit.normal, ray.direction) > 0) hit.normal = -hit.normal;
  return hit;
}

Hit FindHit(const std::vector<Solid>& solids, const RayT<double>& ray, double min_distance) {
  double nearest = kNever;
  int index = -1;
  for (size_t i = 0; i < solids.size(); ++i) {
    const double t = HitDistance(solids[i], ray, min_distance);
    if (t < nearest) nearest = t, index = static_cast<int>(i);
  }
  return HitOf(solids, index, ray, nearest);
}

bool IsShadowed(const std::vector<Solid>& solids, const RayT<double>& ray,
                double min_distance) {
  for (const Solid& solid : solids)
    if (solid.casts_shadow && HitDistance(solid, ray, min_distance) < kNever) return true;
  return false;
}

double ContactReach(const Solid& solid) {
  const double radius = std::max({solid.half.x, solid.half.y, solid.half.z});
  const bool dims = solid.shape != Shape::kBackdrop && solid.casts_shadow && radius <= 0.4;
  return dims ? 4 * radius : 0;
}

}  // namespace regrade
