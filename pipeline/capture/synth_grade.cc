#include "pipeline/capture/synth_grade.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/synthetic/ray_trace.h"

namespace regrade {
namespace {

double SmoothStep(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

// From 1 at a quarter of the scene's extent along x to 0.6 at three quarters.
double LocalFactor(const SyntheticScene& scene, const Camera& camera, int x, int y,
                   double depth) {
  if (!(depth > 0)) return 1;
  const RayT<double> ray = camera.WorldRay(x + 0.5, y + 0.5);
  const Vec3d point =
      ray.origin + ray.direction * (depth / Dot(ray.direction, camera.Forward()));
  const double place =
      (point.x - scene.bounds_min.x) / (scene.bounds_max.x - scene.bounds_min.x);
  return 1 - 0.4 * SmoothStep((place - 0.25) / 0.5);
}

}  // namespace

SynthGrade ParseSynthGrade(const std::string& name) {
  if (name.empty()) return SynthGrade::kNone;
  if (name == "global") return SynthGrade::kGlobal;
  if (name == "local") return SynthGrade::kLocal;
  if (name == "object") return SynthGrade::kObject;
  if (name == "vignette") return SynthGrade::kVignette;
  throw UsageError("there is no grade \"" + name + "\"", "--grade",
                   "use global, local, object or vignette");
}

Vec3d GradeColor(const Vec3d& c) {
  const double light = 0.3 * c.x + 0.6 * c.y + 0.1 * c.z;
  // Warm lights, cold shadows.
  const double warm = 0.12 * (SmoothStep(light) - 0.5);
  // Greens, by how far green is above the other two, turn to yellow.
  const double green = std::max(0.0, c.y - std::max(c.x, c.z));
  const Vec3d toned{c.x + warm + 0.5 * green, c.y, c.z - warm};
  Vec3d graded;
  for (int k = 0; k < 3; ++k) graded[k] = 0.04 + 0.92 * SmoothStep(toned[k]);
  return graded;
}

double VignetteFactor(double r) { return 1 - 0.35 * r * r; }

void ApplyGrade(SynthGrade grade, const SyntheticScene& scene, const Camera& camera,
                const Image& depth, int solid, Image* color) {
  const Image mask =
      grade == SynthGrade::kObject ? RenderSolidMask(scene, camera, solid) : Image();
  const double half_diagonal = 0.5 * std::hypot(color->width, color->height);
#pragma omp parallel for schedule(static)
  for (int y = 0; y < color->height; ++y) {
    for (int x = 0; x < color->width; ++x) {
      float* const p = color->at(x, y);
      Vec3d c{p[0], p[1], p[2]};
      if (grade == SynthGrade::kGlobal || grade == SynthGrade::kVignette) c = GradeColor(c);
      if (grade == SynthGrade::kVignette)
        c = c * VignetteFactor(
                    std::hypot(x + 0.5 - 0.5 * color->width, y + 0.5 - 0.5 * color->height) /
                    half_diagonal);
      if (grade == SynthGrade::kLocal)
        c = c * LocalFactor(scene, camera, x, y, double{*depth.at(x, y)});
      if (grade == SynthGrade::kObject) {
        const double share = *mask.at(x, y);
        c = c * (1 - share) + Vec3d{c.y, c.x, c.z} * share;
      }
      for (int k = 0; k < 3; ++k) p[k] = static_cast<float>(std::clamp(c[k], 0.0, 1.0));
    }
  }
}

}  // namespace regrade
