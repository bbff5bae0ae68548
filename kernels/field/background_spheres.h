// The background beyond the box: layers of colour and density on concentric spheres (a
// multi-sphere image), composited behind the box. The plain specification.
//
// Coordinates: the box is scaled to the cube [-1, 1]^3, so that the unit sphere lies inside it,
// as in svox2. Radii are stored as inverse radii u = 1 / r: no value is large, and u = 0 is
// infinity.
//
// EQ(sphere-crossing): with p the ray's point nearest to the centre, d its direction and
// h = |p|, the ray leaves the sphere 1 / u at x = p + d sqrt(r^2 - h^2), and
//   u x = u p + sqrt(1 - (h u)^2) d,
// a unit vector that needs no radius and does not cancel (H91-H93; the roots of the quadratic
// lose 1e-3 r from a hundred radii away). Only crossings ahead of the ray's origin o count:
// sqrt(1 - (h u)^2) > u o.d.
//
// EQ(background-layers): layer i of L lies at u_i = 1 - (i + 1/2) / L, as in svox2, and covers
// 1 / L of inverse radius: tau_i = max(0, sigma_i) s / L with s the world length of a unit
// along the ray, c_i = max(0, 1/2 + Gamma_0 a_i); sigma_i and a_i are bilinear in the layer's
// map of longitudes and latitudes, an empty texel counting as 0. They continue the sums of
// EQ(composite) behind the box. svox2 takes 2 L + 2 samples and blends between layers.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/base/vec.h"
#include "kernels/field/radiance_field.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/field/volume_rendering.h"
#include "kernels/scene/camera.h"

namespace regrade {

template <typename T>
struct SphereRay {
  Vec3<T> nearest;       // point nearest to the centre, perpendicular to the direction
  Vec3<T> direction;     // unit
  T along = 0;           // origin = nearest + along * direction
  T world_per_unit = 0;  // 0: not a valid ray
};

template <typename T>
HD SphereRay<T> ToSphereRay(const GridFrame& frame, const RayT<T>& ray) {
  using std::isfinite;
  SphereRay<T> result;
  Vec3<T> origin, direction;
  for (int a = 0; a < 3; ++a) {
    origin[a] = (ray.origin[a] - T(frame.center[a])) / T(frame.radius[a]);
    direction[a] = ray.direction[a] / T(frame.radius[a]);
  }
  const T units_per_world = Norm(direction);
  if (!AllFinite(origin) || !(units_per_world > 0) || !isfinite(units_per_world)) return result;
  result.direction = direction / units_per_world;
  result.along = Dot(origin, result.direction);
  result.nearest = origin - result.direction * result.along;
  // Repeated to remove the component along the direction left by rounding.
  const T rest = Dot(result.nearest, result.direction);
  result.nearest = result.nearest - result.direction * rest;
  result.along += rest;
  result.world_per_unit = 1 / units_per_world;
  return result;
}

// See EQ(sphere-crossing): `place` is the unit vector, `ahead` the distance from the ray's
// origin in units of the sphere's radius. False if the ray misses the sphere or starts beyond
// it.
template <typename T>
HD bool CrossSphere(const SphereRay<T>& ray, T inverse_radius, Vec3<T>* place, T* ahead) {
  using std::sqrt;
  const T squared = Dot(ray.nearest, ray.nearest) * inverse_radius * inverse_radius;
  if (!(squared < 1)) return false;
  const T root = sqrt(1 - squared);
  *ahead = root - ray.along * inverse_radius;
  *place = ray.nearest * inverse_radius + ray.direction * root;
  return *ahead > 0;
}

template <typename T>
HD T InverseRadius(int layer, int layers) {
  return 1 - (T(layer) + T(0.5)) / T(layers);
}

// The four texels x * R + y around a direction, numbered as in svox2: y runs from the north
// pole (0, 1, 0) to the south pole in R steps, x eastwards around the sphere in 2 R.
template <typename T>
struct TexelCell {
  int32_t texel[4];
  T weight[4];
};

template <typename T>
HD TexelCell<T> LocateTexel(int resolution, const Vec3<T>& place) {
  using std::atan2;
  using std::sqrt;
  constexpr T kInversePi = T(0.318309886183790672);
  const T longitude = atan2(place.x, place.z);
  const T latitude = atan2(place.y, sqrt(place.x * place.x + place.z * place.z));
  const T x = T(resolution) * (1 + longitude * kInversePi);
  const T y = T(resolution) * (T(0.5) - latitude * kInversePi);
  const int columns = 2 * resolution;
  int x0 = x > 0 ? static_cast<int>(x) : 0, y0 = y > 0 ? static_cast<int>(y) : 0;
  if (x0 > columns - 1) x0 = columns - 1;
  if (y0 > resolution - 1) y0 = resolution - 1;
  const T fx = x - T(x0), fy = y - T(y0);
  const int x1 = x0 + 1 < columns ? x0 + 1 : 0;
  const int y1 = y0 + 1 < resolution ? y0 + 1 : y0;
  return {
      {x0 * resolution + y0, x0 * resolution + y1, x1 * resolution + y0, x1 * resolution + y1},
      {(1 - fx) * (1 - fy), (1 - fx) * fy, fx * (1 - fy), fx * fy}};
}

// The direction of texel (x, y): the inverse of LocateTexel.
template <typename T>
HD Vec3<T> TexelDirection(int resolution, int x, int y) {
  using std::cos;
  using std::sin;
  constexpr T kPi = T(3.14159265358979324);
  const T longitude = (T(x) / T(resolution) - 1) * kPi;
  const T latitude = (T(0.5) - T(y) / T(resolution)) * kPi;
  return {cos(latitude) * sin(longitude), sin(latitude), cos(latitude) * cos(longitude)};
}

// A layer's value at a ray's crossing: value [4] = a_red, a_green, a_blue, sigma.
template <typename T>
HD void SampleLayer(const SpheresView<T>& spheres, const TexelCell<T>& cell, int layer,
                    T* value) {
  for (int c = 0; c < 4; ++c) value[c] = 0;
  for (int k = 0; k < 4; ++k) {
    const int32_t column = spheres.links[cell.texel[k]];
    if (column < 0) continue;
    const int64_t texel = static_cast<int64_t>(column) * spheres.layers + layer;
    for (int c = 0; c < 3; ++c) value[c] += cell.weight[k] * spheres.color[3 * texel + c];
    value[3] += cell.weight[k] * spheres.density[texel];
  }
}

template <typename T>
HD Vec3<T> LayerColor(const T* value) {
  Vec3<T> color;
  for (int c = 0; c < 3; ++c) {
    const T raw = T(0.5) + T(kSh0) * value[c];
    color[c] = raw > 0 ? raw : T(0);
  }
  return color;
}

template <typename T>
struct SpheresResult {
  T optical_depth = 0;  // of the layers only
  T depth = 0;          // sum w t of the layers, world units
  int last_layer = -1;
};

// Continues compositing behind the box, with the same stopping rule as the box.
template <typename T>
HD SpheresResult<T> CompositeSpheres(const GridFrame& frame, const SpheresView<T>& spheres,
                                     const RayT<T>& world_ray, T stop_transmittance,
                                     CompositeState<T>* state) {
  SpheresResult<T> result;
  if (state->transmittance < stop_transmittance) return result;
  const SphereRay<T> ray = ToSphereRay(frame, world_ray);
  if (!(ray.world_per_unit > 0)) return result;
  const T delta = ray.world_per_unit / T(spheres.layers);
  for (int i = 0; i < spheres.layers; ++i) {
    const T u = InverseRadius<T>(i, spheres.layers);
    Vec3<T> place;
    T ahead, value[4];
    if (!CrossSphere(ray, u, &place, &ahead)) continue;
    SampleLayer(spheres, LocateTexel(spheres.resolution, place), i, value);
    if (!(value[3] > 0)) continue;
    const T tau = OpticalDepth(value[3], delta);
    result.depth += Composite(tau, LayerColor(value), state) * ahead / u * ray.world_per_unit;
    result.optical_depth += tau;
    result.last_layer = i;
    if (state->transmittance < stop_transmittance) break;
  }
  return result;
}

// EQ(composite-adjoint) over the layers, last to first. `behind` is c_bg on entry and the
// radiance behind the box on return; depth_before: optical depth of the box. The gradients have
// the shapes of density and color.
template <typename T, typename Add>
HD void CompositeSpheresAdjoint(const GridFrame& frame, const SpheresView<T>& spheres,
                                const RayT<T>& world_ray, const SpheresResult<T>& result,
                                T depth_before, const Vec3<T>& d_color, Vec3<T>* behind,
                                T* d_density, T* d_texel_color, const Add& add) {
  using std::exp;
  const SphereRay<T> ray = ToSphereRay(frame, world_ray);
  const T delta = ray.world_per_unit / T(spheres.layers);
  T depth_after = depth_before + result.optical_depth;
  for (int i = result.last_layer; i >= 0; --i) {
    Vec3<T> place;
    T ahead, value[4];
    if (!CrossSphere(ray, InverseRadius<T>(i, spheres.layers), &place, &ahead)) continue;
    const TexelCell<T> cell = LocateTexel(spheres.resolution, place);
    SampleLayer(spheres, cell, i, value);
    if (!(value[3] > 0)) continue;
    const T tau = OpticalDepth(value[3], delta);
    const T w = exp(-(depth_after - tau)) * Opacity(tau);
    T d_sigma =
        CompositeAdjoint(delta, tau, exp(-depth_after), LayerColor(value), d_color, behind);
    if (!(value[3] < T(kMaxDensity)) || !(value[3] * delta < T(kMaxOpticalDepth))) d_sigma = 0;
    for (int k = 0; k < 4; ++k) {
      const int32_t column = spheres.links[cell.texel[k]];
      if (column < 0) continue;
      const int64_t texel = static_cast<int64_t>(column) * spheres.layers + i;
      for (int c = 0; c < 3; ++c)
        if (T(0.5) + T(kSh0) * value[c] > 0)
          add(&d_texel_color[3 * texel + c], cell.weight[k] * w * T(kSh0) * d_color[c]);
      add(&d_density[texel], cell.weight[k] * d_sigma);
    }
    depth_after -= tau;
  }
}

}  // namespace regrade
