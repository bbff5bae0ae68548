// A field's values in double, for code that is compared with itself in higher precision.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/field/render_ray.h"
#include "kernels/field/trilinear.h"
#include "kernels/scene/camera.h"

namespace regrade::testing {

// A field in double with the float field's values. `field` must outlive it.
struct DoubleField {
  explicit DoubleField(const RadianceField& field)
      : geometry(*field.geometry),
        density(geometry.density.begin(), geometry.density.end()),
        sh(field.appearance.sh.begin(), field.appearance.sh.end()),
        basis(field.appearance.basis),
        background(field.background.Cast<double>()),
        sphere_density(geometry.spheres.density.begin(), geometry.spheres.density.end()),
        sphere_color(field.appearance.sphere_color.begin(),
                     field.appearance.sphere_color.end()) {}
  FieldView<double> view() const {
    return {geometry.frame,
            geometry.links.data(),
            density.data(),
            sh.data(),
            basis,
            background,
            0.0,
            {geometry.spheres.layers, geometry.spheres.resolution,
             geometry.spheres.links.data(), sphere_density.data(), sphere_color.data()}};
  }
  const Geometry& geometry;
  std::vector<double> density, sh;
  int basis;
  Vec3d background;
  std::vector<double> sphere_density, sphere_color;
};

// Squared error of rays to targets, and its gradient times `scale` by all values of a field.
struct ExactGradient {
  double error = 0;
  std::vector<double> density, sh, sphere_density, sphere_color;

  template <typename Rays, typename Targets>
  ExactGradient(const DoubleField& field, const Rays& rays, const Targets& targets,
                const MarchOptions& options, double scale, const DensityLosses& losses = {})
      : density(field.density.size()),
        sh(field.sh.size()),
        sphere_density(field.sphere_density.size()),
        sphere_color(field.sphere_color.size()) {
    auto target = targets.begin();
    for (const Ray& single : rays) {
      const RayT<double> ray{single.origin.Cast<double>(), single.direction.Cast<double>()};
      const RayResult<double> result = RenderRay(field.view(), ray, options);
      const Vec3d e = result.color - (*target++).template Cast<double>();
      error += Dot(e, e);
      RenderRayAdjoint<double>(field.view(), ray, options, result, e * (2.0 * scale),
                               density.data(), sh.data(), PlainAdd(), sphere_density.data(),
                               sphere_color.data(), losses);
    }
  }
};

inline double Largest(const std::vector<double>& values) {
  double largest = 0;
  for (const double v : values) largest = std::max(largest, std::abs(v));
  return largest;
}

// Normalised again: a float direction has unit length only to 1e-7.
inline RayT<double> ToDouble(const Ray& ray) {
  return {ray.origin.Cast<double>(), Normalized(ray.direction.Cast<double>())};
}

}  // namespace regrade::testing
