// A field's values in double, for bodies that are checked against themselves in higher
// precision.
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
        background(field.background.Cast<double>()) {}
  FieldView<double> view() const {
    return {geometry.frame,
            geometry.links.data(),
            density.data(),
            sh.data(),
            basis,
            background,
            0.0};
  }
  const Geometry& geometry;
  std::vector<double> density, sh;
  int basis;
  Vec3d background;
};

// Normalised anew: a float direction is a unit one to 1e-7 only.
inline RayT<double> ToDouble(const Ray& ray) {
  return {ray.origin.Cast<double>(), Normalized(ray.direction.Cast<double>())};
}

}  // namespace regrade::testing
