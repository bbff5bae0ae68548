// Splats at one pixel, front to back, and their adjoint.
//
// EQ(splat-composite), Kerbl et al. 2023, eq. 3: for alpha_i see EQ(splat-opacity), for c_i
// EQ(splat-color);
//   T_0 = 1,  w_i = T_i alpha_i,  T_{i+1} = T_i (1 - alpha_i),
//   C = sum_i w_i c_i + T_N c_bg,   Z = sum_i w_i z_i,   sum_i w_i + T_N = 1.
// The splat after which T would be below 1e-4, and all behind it, are left out. Z over 1 - T_N
// is the expected depth; the median depth is the z of the splat at which T becomes 1/2 or less,
// 0 if none does (it is constant between such splats, and has no gradient here).
//
// EQ(splat-composite-adjoint): with R_N = (c_bg, 0, 1) and R_i = alpha_i (c_i, z_i, 0) +
// (1 - alpha_i) R_{i+1}, what the pixel would show in (C, Z, T) if splat i were the first,
//   d_alpha_i = T_i <(c_i, z_i, 0) - R_{i+1}, (d_C, d_Z, d_T)>,  d_c_i = w_i d_C,
//   d_z_i = w_i d_Z,  d_c_bg = T_N d_C;   g_i = alpha_i d_alpha_i, the gradient by ln alpha_i.
// T_i is kept from the forward pass. The published way, back to front from T_N by T_i = T_{i+1}
// / (1 - alpha_i), adds a rounding for each splat and divides by 0.01 at opaque ones; front to
// back, with the pixel's total less what is in front, R_{i+1} = (C - ...) / T_{i+1} cancels
// where T is small.
//
// Tile by tile it is cpu/splat_tile_simd.h and cuda/composite_tiles.cu, cuda/tile_adjoint.cu.
#pragma once

#include <cmath>

#include "kernels/base/vec.h"
#include "kernels/splats/extent.h"

namespace regrade {

template <typename T>
struct PixelState {
  Vec3<T> color{};  // sum w c, without the background
  T depth = 0;      // sum w z
  T median_depth = 0;
  T transmittance = 1;
};

// A splat at a pixel.
template <typename T>
struct SplatHit {
  T alpha = 0;
  T w[2]{};              // whitened offset, see EQ(splat-projection)
  bool limited = false;  // alpha is 0.99
};

// EQ(splat-opacity), Kerbl et al. 2023: o = 1 / (1 + exp(-x)) of the logit x, alpha = min(0.99,
// o rho exp(-q / 2)), left out where o rho exp(-q / 2) < 1 / 255. In logarithms, which keep all
// digits at both ends: ln o = -log1p(exp(-|x|)) + min(x, 0), ln alpha = ln o + ln rho - q / 2,
// d ln o / dx = 1 / (1 + exp(x)). At the limit 0.99 and beyond, d alpha = 0.
//
// False where the place (u, v), in pixels, does not see the splat.
template <typename T>
HD bool HitSplatAt(const ScreenEllipse<T>& ellipse, T log_opacity, T reach, double u, double v,
                   SplatHit<T>* hit) {
  using std::exp;
  ellipse.Whiten(static_cast<T>(u - ellipse.u), static_cast<T>(v - ellipse.v), hit->w);
  const T q = hit->w[0] * hit->w[0] + hit->w[1] * hit->w[1];
  if (!(q <= reach)) return false;
  const T alpha = exp(log_opacity - q / 2);
  hit->limited = !(alpha < T(kMaxAlpha));
  hit->alpha = hit->limited ? T(kMaxAlpha) : alpha;
  return true;
}

// Of pixel (x, y), whose centre is at + 0.5.
template <typename T>
HD bool HitSplat(const ScreenEllipse<T>& ellipse, T log_opacity, T reach, int x, int y,
                 SplatHit<T>* hit) {
  return HitSplatAt(ellipse, log_opacity, reach, x + 0.5, y + 0.5, hit);
}

// Adds a splat; false, and nothing added, if the pixel ends before it.
template <typename T>
HD bool CompositeSplat(T alpha, const Vec3<T>& color, T z, PixelState<T>* state) {
  const T after = state->transmittance * (1 - alpha);
  if (after < T(kMinTransmittance)) return false;
  const T weight = state->transmittance * alpha;
  state->color += color * weight;
  state->depth += z * weight;
  if (state->transmittance > T(0.5) && !(after > T(0.5))) state->median_depth = z;
  state->transmittance = after;
  return true;
}

// A pixel's gradient, and R_{i+1} of EQ(splat-composite-adjoint).
template <typename T>
struct PixelAdjoint {
  Vec3<T> d_color;
  T d_depth = 0, d_transmittance = 0;
  Vec3<T> color_behind;  // starts as the background
  T depth_behind = 0, clear_behind = 1;

  // For splats last to first; returns g_i. `transmittance`: T_i, before the splat.
  HD T Step(const SplatHit<T>& hit, T transmittance, const Vec3<T>& color, T z) {
    const T d_alpha =
        transmittance * (Dot(color - color_behind, d_color) + (z - depth_behind) * d_depth -
                         clear_behind * d_transmittance);
    const T clear = 1 - hit.alpha;
    color_behind = color * hit.alpha + color_behind * clear;
    depth_behind = z * hit.alpha + depth_behind * clear;
    clear_behind = clear_behind * clear;
    return hit.limited ? T(0) : hit.alpha * d_alpha;
  }
};

}  // namespace regrade
