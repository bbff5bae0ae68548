// A splat's colour as a camera sees it, and its adjoint.
//
// EQ(splat-color), Kerbl et al. 2023: see EQ(sh-basis), d the direction from the camera's
// centre to the mean, in double before rounding. Where 1/2 + sum_k sh_k Gamma_k(d) <= 0, a
// channel is 0 and its gradient, too. By the mean, d = r / |r|: d_r = (d_d - d <d, d_d>) / |r|.
#pragma once

#include "kernels/base/vec.h"
#include "kernels/field/spherical_harmonics.h"

namespace regrade {

template <typename T>
struct SplatDirection {
  Vec3<T> unit;
  T inverse_distance = 0;  // 1 / world units
};

// `mean` must not be the centre: it is beyond a near plane.
template <typename T>
HD SplatDirection<T> DirectionToMean(const Vec3d& center, const Vec3<T>& mean) {
  const Vec3d r = mean.template Cast<double>() - center;
  const double distance = Norm(r);
  return {(r / distance).template Cast<T>(), static_cast<T>(1 / distance)};
}

// sh [3, basis].
template <typename T>
HD Vec3<T> SplatColor(int basis, const T* sh, const Vec3<T>& direction) {
  T gamma[kMaxBasis];
  ShBasis(basis, direction, gamma);
  Vec3<T> color;
  for (int c = 0; c < 3; ++c) {
    T sum = T(0.5);
    for (int k = 0; k < basis; ++k) sum += sh[c * basis + k] * gamma[k];
    color[c] = sum > 0 ? sum : T(0);
  }
  return color;
}

// Adds to d_sh [3, basis] and d_mean. `color`: what SplatColor returned.
template <typename T>
HD void SplatColorAdjoint(int basis, const T* sh, const SplatDirection<T>& direction,
                          const Vec3<T>& color, const Vec3<T>& d_color, T* d_sh,
                          Vec3<T>* d_mean) {
  T gamma[kMaxBasis], d_gamma[kMaxBasis] = {};
  ShBasis(basis, direction.unit, gamma);
  for (int c = 0; c < 3; ++c) {
    if (!(color[c] > 0)) continue;
    for (int k = 0; k < basis; ++k) {
      d_sh[c * basis + k] += d_color[c] * gamma[k];
      d_gamma[k] += d_color[c] * sh[c * basis + k];
    }
  }
  const Vec3<T> d = ShBasisAdjoint(basis, direction.unit, d_gamma);
  const Vec3<T> across = d - direction.unit * Dot(direction.unit, d);
  *d_mean += across * direction.inverse_distance;
}

}  // namespace regrade
