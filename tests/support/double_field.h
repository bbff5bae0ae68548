// A field's values in double, for code that is compared with itself in higher precision.
#pragma once

#include <vector>

#include "kernels/field/radiance_field.h"
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

// Normalised again: a float direction has unit length only to 1e-7.
inline RayT<double> ToDouble(const Ray& ray) {
  return {ray.origin.Cast<double>(), Normalized(ray.direction.Cast<double>())};
}

}  // namespace regrade::testing
