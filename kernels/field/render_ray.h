// One ray through the field, forward and adjoint: the plain specification of rendering and
// fitting.
//
// EQ(fit-loss): L = 1 / (3 Q) sum over the batch's Q rays and 3 channels of (C - C_photo)^2
// (svox2's gradient 2 / (3 Q) (C - C_photo)); the scale 1 / (3 Q) is passed in. The adjoint
// visits the same samples back to front (see EQ(composite-adjoint)) and recovers T_{i+1} =
// exp(-sum_{j<=i} tau_j) from the running optical depth: it needs no storage and no division.
#pragma once

#include <cmath>

#include "kernels/field/background_spheres.h"
#include "kernels/field/density_losses.h"
#include "kernels/field/radiance_field.h"
#include "kernels/field/ray_march.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/field/trilinear.h"
#include "kernels/field/volume_rendering.h"

namespace regrade {

template <typename T>
struct RayResult {
  Vec3<T> color{};           // not clipped
  T transmittance = 1;       // behind the last sample
  T depth = 0;               // sum w t, t in world units along the ray
  T optical_depth = 0;       // sum tau of the box
  int64_t last_step = -1;    // index of the last sample of the box that was composited
  SpheresResult<T> spheres;  // contribution of the background's layers, included above
};

// See EQ(sh-basis): raw [3] is before the clamp at 0.
template <typename T>
HD Vec3<T> SampleColor(const FieldView<T>& field, const Cell<T>& cell, const T* gamma,
                       Vec3<T>* raw) {
  T sh[3 * kMaxBasis];
  const int stride = 3 * field.basis;
  Interpolate(field.frame, field.links, field.sh, stride, stride, cell, sh);
  Vec3<T> color;
  for (int c = 0; c < 3; ++c) {
    T sum = T(0.5);
    for (int k = 0; k < field.basis; ++k) sum += sh[c * field.basis + k] * gamma[k];
    (*raw)[c] = sum;
    color[c] = sum > 0 ? sum : T(0);
  }
  return color;
}

// The samples of the box on a ray, without what is behind them.
template <typename T>
HD void CompositeGrid(const FieldView<T>& field, const RayT<T>& ray,
                      const MarchOptions& options, CompositeState<T>* state,
                      RayResult<T>* result) {
  const GridRay<T> march =
      ClipToGrid(field.frame, ray, field.near_clip, static_cast<T>(options.step));
  const T delta = T(options.step) * march.world_per_voxel;
  T gamma[kMaxBasis];
  ShBasis(field.basis, ray.direction, gamma);
  for (int64_t i = 0; i < march.num_steps; ++i) {
    const T t = march.t_begin + T(i) * T(options.step);
    const Cell<T> cell = LocateCell(field.frame, march.At(t));
    T density;
    Interpolate(field.frame, field.links, field.density, 1, 1, cell, &density);
    if (!(density > 0)) continue;
    const T tau = OpticalDepth(density, delta);
    Vec3<T> raw;
    const Vec3<T> color = SampleColor(field, cell, gamma, &raw);
    result->depth += Composite(tau, color, state) * t * march.world_per_voxel;
    result->optical_depth += tau;
    result->last_step = i;
    if (state->transmittance < T(options.stop_transmittance)) break;
  }
}

template <typename T>
HD RayResult<T> RenderRay(const FieldView<T>& field, const RayT<T>& ray,
                          const MarchOptions& options) {
  RayResult<T> result;
  CompositeState<T> state;
  CompositeGrid(field, ray, options, &state, &result);
  if (field.spheres.layers > 0) {
    result.spheres = CompositeSpheres(field.frame, field.spheres, ray,
                                      T(options.stop_transmittance), &state);
    result.depth += result.spheres.depth;
  }
  result.transmittance = state.transmittance;
  result.color = state.color + field.background * state.transmittance;
  return result;
}

// Adds dL/d(density), dL/d(sh) for dL/dC = d_color to the gradients, which have the field's
// shapes, and that of the losses of densities; the sphere gradients may be null for a field
// without layers. `result` is RenderRay's of the same arguments. `Add(pointer, value)` is a
// plain or an atomic +=.
template <typename T, typename Add>
HD void RenderRayAdjoint(const FieldView<T>& field, const RayT<T>& ray,
                         const MarchOptions& options, const RayResult<T>& result,
                         const Vec3<T>& d_color, T* d_density, T* d_sh, const Add& add,
                         T* d_sphere_density = nullptr, T* d_sphere_color = nullptr,
                         const DensityLosses& losses = {}) {
  using std::exp;
  const GridRay<T> march =
      ClipToGrid(field.frame, ray, field.near_clip, static_cast<T>(options.step));
  const T delta = T(options.step) * march.world_per_voxel;
  T gamma[kMaxBasis];
  ShBasis(field.basis, ray.direction, gamma);
  const int stride = 3 * field.basis;
  Vec3<T> behind = field.background;
  if (field.spheres.layers > 0)
    CompositeSpheresAdjoint(field.frame, field.spheres, ray, result.spheres,
                            result.optical_depth, d_color, &behind, d_sphere_density,
                            d_sphere_color, add);
  T depth_after = result.optical_depth;  // sum of tau up to and including the sample
  for (int64_t i = result.last_step; i >= 0; --i) {
    const T t = march.t_begin + T(i) * T(options.step);
    const Cell<T> cell = LocateCell(field.frame, march.At(t));
    T density;
    Interpolate(field.frame, field.links, field.density, 1, 1, cell, &density);
    if (!(density > 0)) continue;
    const T tau = OpticalDepth(density, delta);
    Vec3<T> raw;
    const Vec3<T> color = SampleColor(field, cell, gamma, &raw);
    const T transmittance_after = exp(-depth_after);
    const T w = exp(-(depth_after - tau)) * Opacity(tau);
    T d_sigma = CompositeAdjoint(delta, tau, transmittance_after, color, d_color, &behind) +
                DensityLossSlope(losses, exp(-result.optical_depth), density, delta);
    if (!(density < T(kMaxDensity)) || !(density * delta < T(kMaxOpticalDepth))) d_sigma = 0;
    T d_sample[3 * kMaxBasis];
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < field.basis; ++k)  // subgradient 0 of the clamp
        d_sample[c * field.basis + k] = raw[c] > 0 ? w * d_color[c] * gamma[k] : T(0);
    InterpolateAdjoint(field.frame, field.links, 1, 1, cell, &d_sigma, d_density, add);
    InterpolateAdjoint(field.frame, field.links, stride, stride, cell, d_sample, d_sh, add);
    depth_after -= tau;
  }
}

}  // namespace regrade
