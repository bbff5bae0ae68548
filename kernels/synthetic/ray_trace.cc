#include "kernels/synthetic/ray_trace.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/scene/srgb.h"
#include "kernels/synthetic/solid_index.h"

namespace regrade {
namespace {

constexpr double kOffset = 1e-7;  // world units: avoids self-intersection
// Side of the square over which a pixel integrates light, in pixels: a lens is slightly softer
// than its sensor.
constexpr double kFootprint = 1.6;

// The order in which a pixel's 4x4 sub-cells are sampled: the first four have one in each row
// and each column, so that their mean is already exact for a linear ramp.
constexpr int kFirstCells = 4, kCells = 16;
constexpr int kCellOrder[kCells] = {4, 13, 2, 11, 0, 1, 3, 5, 6, 7, 8, 9, 10, 12, 14, 15};
// A pixel is flat if its first samples differ by less than this, in linear light.
constexpr double kFlat = 0.02;

// Fraction of sky light not occluded by nearby balls and pots; each hides about cos * (r / d)^2
// for a disc of radius r at distance d in direction n. Gives contact shadows.
double SkyVisibility(const SyntheticScene& scene, const SolidIndex& index, const Hit& hit) {
  double visibility = 1;
  for (const int i : index.ThoseInReach(hit.point)) {
    const Solid& solid = scene.solids[i];
    if (i == hit.solid) continue;
    const Vec3d to = solid.center - hit.point;
    const double d2 = Dot(to, to);
    const double radius = std::max({solid.half.x, solid.half.y, solid.half.z});
    if (d2 > 16 * radius * radius) continue;
    const double facing = std::max(0.0, Dot(hit.normal, to)) / std::sqrt(d2);
    visibility *= 1 - 0.7 * facing * std::min(1.0, radius * radius / d2);
  }
  return visibility;
}

// Linear RGB radiance towards the ray's origin.
Vec3d Light(const SyntheticScene& scene, const SolidIndex& index, const Vec3d& direction,
            const Hit& hit, bool highlights) {
  if (hit.solid < 0) return {};
  const Solid& solid = scene.solids[hit.solid];
  const Vec3d albedo = Albedo(solid.paint, hit.u, hit.v);
  const double facing = Dot(hit.normal, scene.to_sun);
  double sun = 0;
  if (facing > 0 &&
      !index.IsShadowed({hit.point + hit.normal * kOffset, scene.to_sun}, kOffset))
    sun = facing * scene.sun;
  const double sky =
      scene.ambient * (0.8 + 0.2 * hit.normal.z) * SkyVisibility(scene, index, hit);
  // The sun is slightly warm, the sky slightly cold.
  const Vec3d light = Vec3d{1.04, 1.0, 0.93} * sun + Vec3d{0.95, 1.0, 1.08} * sky;
  Vec3d result = {albedo.x * light.x, albedo.y * light.y, albedo.z * light.z};
  if (highlights && sun > 0 && solid.gloss > 0) {
    const Vec3d halfway = Normalized(scene.to_sun - direction);
    const double mirror = std::pow(std::max(0.0, Dot(hit.normal, halfway)), kSunSharpness);
    result += Vec3d{1, 1, 1} * (solid.gloss * mirror);
  }
  return result;
}

// Rays of one camera; its centre is computed once.
class RaySource {
 public:
  explicit RaySource(const Camera& camera)
      : camera_(camera), world_from_camera_(camera.camera_from_world.Inverse()) {}

  RayT<double> operator()(double u, double v) const {
    return {world_from_camera_.translation,
            Normalized(world_from_camera_.rotation * camera_.CameraRay(u, v))};
  }

 private:
  const Camera& camera_;
  const RigidTransform world_from_camera_;
};

Vec3d PixelLight(const SyntheticScene& scene, const SolidIndex& index, const RaySource& rays,
                 int x, int y, bool highlights) {
  Vec3d sum, low, high;
  int solid = -1;
  bool flat = true;
  for (int k = 0; k < kCells; ++k) {
    if (k == kFirstCells && flat && high.x - low.x < kFlat && high.y - low.y < kFlat &&
        high.z - low.z < kFlat)
      return sum / kFirstCells;
    const int cell = kCellOrder[k];
    const RayT<double> ray = rays(x + 0.5 + kFootprint * (cell % 4 - 1.5) / 4,
                                  y + 0.5 + kFootprint * (cell / 4 - 1.5) / 4);
    const Hit hit = index.FindHit(ray, kOffset);
    const Vec3d light = Light(scene, index, ray.direction, hit, highlights);
    sum += light;
    if (k == 0) solid = hit.solid, low = high = light;
    flat = flat && hit.solid == solid;
    for (int c = 0; c < 3; ++c) {
      low[c] = std::min(low[c], light[c]);
      high[c] = std::max(high[c], light[c]);
    }
  }
  return sum / kCells;
}

}  // namespace

SyntheticView RenderSyntheticView(const SyntheticScene& scene, const Camera& camera,
                                  bool highlights) {
  SyntheticView view{Image(camera.width, camera.height, 3),
                     Image(camera.width, camera.height, 1)};
  const SolidIndex index(scene.solids);
  const RaySource rays(camera);
#pragma omp parallel for schedule(dynamic)
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Vec3d light = PixelLight(scene, index, rays, x, y, highlights);
      for (int c = 0; c < 3; ++c)
        view.color.at(x, y)[c] = static_cast<float>(SrgbFromLinear(std::min(1.0, light[c])));
      const Hit hit = index.FindHit(rays(x + 0.5, y + 0.5), kOffset);
      if (hit.solid >= 0)
        *view.depth.at(x, y) = static_cast<float>((camera.camera_from_world * hit.point).z);
    }
  return view;
}

Image RenderSolidMask(const SyntheticScene& scene, const Camera& camera, int solid) {
  constexpr int kSide = 4;  // rays along a pixel's side
  Image mask(camera.width, camera.height, 1);
  const SolidIndex index(scene.solids);
  const RaySource rays(camera);
#pragma omp parallel for schedule(dynamic)
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      int hits = 0;
      for (int k = 0; k < kSide * kSide; ++k)
        hits += index
                    .FindHit(rays(x + (k % kSide + 0.5) / kSide, y + (k / kSide + 0.5) / kSide),
                             kOffset)
                    .solid == solid;
      *mask.at(x, y) = static_cast<float>(hits) / (kSide * kSide);
    }
  return mask;
}

SyntheticMotion TrueMotion(const SyntheticScene& scene, const Camera& from, const Camera& to) {
  SyntheticMotion motion;
  motion.width = from.width;
  motion.height = from.height;
  const size_t pixels = static_cast<size_t>(from.width) * from.height;
  motion.uv.assign(2 * pixels, std::numeric_limits<float>::quiet_NaN());
  motion.visible.assign(pixels, 0);
  const SolidIndex index(scene.solids);
  const RaySource rays(from);
  const Vec3d eye = to.Center();
#pragma omp parallel for schedule(dynamic)
  for (int y = 0; y < from.height; ++y)
    for (int x = 0; x < from.width; ++x) {
      const size_t pixel = static_cast<size_t>(y) * from.width + x;
      const Hit hit = index.FindHit(rays(x + 0.5, y + 0.5), kOffset);
      double u, v;
      if (hit.solid < 0 || !to.Project(hit.point, &u, &v)) continue;
      motion.uv[2 * pixel] = static_cast<float>(u - (x + 0.5));
      motion.uv[2 * pixel + 1] = static_cast<float>(v - (y + 0.5));
      if (!(u >= 0 && u <= to.width && v >= 0 && v <= to.height)) continue;
      const Vec3d sight = hit.point - eye;
      const double distance = Norm(sight);
      const Hit first = index.FindHit({eye, sight / distance}, kOffset);
      motion.visible[pixel] = first.distance > distance - 1e-6;
    }
  return motion;
}

}  // namespace regrade
