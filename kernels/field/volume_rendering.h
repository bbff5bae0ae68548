// Emission-absorption along one ray, and its adjoint.
//
// EQ(composite), Max 1995, as in LipRF eq. 2-3:
//   tau_i = sigma_i delta_i,  alpha_i = -expm1(-tau_i),  T_0 = 1,  T_{i+1} = T_i exp(-tau_i),
//   w_i = T_i alpha_i,  C = sum_i w_i c_i + T_N c_bg;      sum_i w_i + T_N = 1.
//
// EQ(composite-adjoint), suffix form: with R_N = c_bg and R_i = alpha_i c_i + (1 - alpha_i)
// R_{i+1},
//   dC/dsigma_i = delta_i T_{i+1} (c_i - R_{i+1}),   dC/dc_i = w_i,   dC/dc_bg = T_N.
// No division by 1 - alpha, every factor bounded; total-minus-prefix has the wrong sign on 2-3
// % of strongly occluded samples in float.
#pragma once

#include <cmath>

#include "kernels/base/host_device.h"
#include "kernels/base/vec.h"

namespace regrade {

inline constexpr double kMaxDensity =
    1e9;  // per world unit: bounds sigma, so that sigma * delta is defined for delta = 0
inline constexpr double kMaxOpticalDepth = 104;  // expf(-104) is 0

// Optical depth of one sample; negative or NaN density gives 0 (the optimizer's step counts
// NaNs).
template <typename T>
HD T OpticalDepth(T density, T delta) {
  const T sigma = density > 0 ? (density < T(kMaxDensity) ? density : T(kMaxDensity)) : T(0);
  const T tau = sigma * delta;
  return tau < T(kMaxOpticalDepth) ? tau : T(kMaxOpticalDepth);
}

template <typename T>
HD T Opacity(T tau) {
  using std::expm1;
  return -expm1(-tau);
}

template <typename T>
struct CompositeState {
  T transmittance = 1;
  Vec3<T> color{};
};

// Adds a sample; returns its weight w.
template <typename T>
HD T Composite(T tau, const Vec3<T>& color, CompositeState<T>* state) {
  using std::exp;
  const T w = state->transmittance * Opacity(tau);
  state->color += color * w;
  state->transmittance *= exp(-tau);
  return w;
}

// One step of the backward pass: call it per sample, last to first. `behind` starts as c_bg and
// is R_{i+1} on entry, R_i on return. Returns dL/dsigma_i for dL/dC = d_color; T_{i+1} is the
// transmittance after the sample.
template <typename T>
HD T CompositeAdjoint(T delta, T tau, T transmittance_after, const Vec3<T>& color,
                      const Vec3<T>& d_color, Vec3<T>* behind) {
  using std::exp;
  const T d_sigma = delta * transmittance_after * Dot(color - *behind, d_color);
  *behind = color * Opacity(tau) + *behind * exp(-tau);
  return d_sigma;
}

}  // namespace regrade
