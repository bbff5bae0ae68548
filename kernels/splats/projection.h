// A splat's ellipse on the screen, and its adjoint.
//
// EQ(splat-projection), Zwicker et al. 2001 as in Kerbl et al. 2023, eq. 5: with p = (x, y, z)
// the mean in camera coordinates and W the camera's rotation,
//   (u, v) = (fx x / z + cx, fy y / z + cy),   S = J W Sigma W^T J^T + s I,
//   J = [fx / z, 0, -fx t_x / z;  0, fy / z, -fy t_y / z],   s = `blur`, see EQ(splat-filter),
// t_x and t_y being x / z and y / z, limited to 1.3 times half the picture's extent from its
// middle: W / 2 - cx +- 1.3 W / 2 over fx, and so for y. Where the limit holds, t is constant.
// Splats with z below the near plane, or whose mean is more than kMaxOffset pixels off, are
// left out. p, u and v are in double: in a float, the pixels at the right of a picture 16k wide
// have steps of 1 / 1024 pixel.
//
// Sums of squares instead of S, so that a needle or a disc seen edge-on keeps its thin axis in
// float. A = J W R diag(exp(l)) with rows a_0, a_1: S = A A^T + s I = C C^T,
//   C = [c00, 0; c10, c11],  c00^2 = |a_0|^2 + s,  c10 = a_0.a_1 / c00,
//   c11^2 = (|n|^2 + s (c00^2 + |a_1|^2)) / c00^2,   n = a_0 x a_1,
// no term of which is a difference (|n|^2 = det(A A^T)). n has a closed form, too: with v_k the
// columns of W R and t = (t_x, t_y, 1), n_k = s_i s_j fx fy / z^2 t.v_k for (i, j, k) cyclic.
// A pixel at d from the mean has q = d^T S^-1 d = |w|^2 with C w = d.
//
// EQ(splat-filter): a fit sees its splats with their blur, which belongs to them. In a picture
// with r times the pixels for an angle that is e = r^2 `blur`; where it is below one pixel's,
// opacity times rho = sqrt(det(A A^T + e I) / det S) makes up for the rest:
//   s = max(1, r^2) `blur`,   det(A A^T + e I) = |n|^2 + e (|a_0|^2 + |a_1|^2) + e^2,
// which is no difference. With r = 0 it is the 2D Mip filter of Yu et al. 2024
// (Mip-Splatting) with sigmoid(logit) as opacity: rho = |n| / (c00 c11).
//
// EQ(splat-projection-adjoint): pixels enter by sums of numbers of size 1. With g a pixel's
// gradient by ln alpha, h = sum g w, H = sum g w w^T, f = sum g, and the rows b of
//   B = C^-1 A:  b_0 = a_0 / c00,  b_1 = s a_1 / (c00^2 c11) + n / (c00 c11) x b_0
// (entries at most 1; a_1 - c10 b_0 would cancel), for the logarithms l of the scales
//   d_(u, v) = C^-T h,   d_A = C^-T H B,   d_l = diag(B^T H B),
// and for rho with r = 0 (see EQ(splat-filter); d ln|n| = sum_k (n_k / |n|^2) d n_k)
//   d_A += f (d ln|n| / dA - C^-T B),   d_l_k += f (1 - n_k^2 / |n|^2 - |column k of B|^2).
#pragma once

#include <cmath>
#include <type_traits>

#include "kernels/base/vec.h"
#include "kernels/splats/covariance.h"
#include "kernels/splats/splat_camera.h"
#include "kernels/splats/splats.h"

namespace regrade {

inline constexpr double kMaxOffset = 1e7;  // pixels
inline constexpr double kMaxSlope = 1.3;   // of half the field of view

// |v|, with squares that neither over- nor underflow.
template <typename T>
HD T ScaledNorm(const Vec3<T>& v) {
  using std::abs, std::sqrt;
#if !defined(__CUDA_ARCH__)
  if constexpr (std::is_same_v<T, float>) {
    const Vec3d wide = v.template Cast<double>();
    return static_cast<float>(sqrt(Dot(wide, wide)));
  }
#endif
  T most = abs(v.x) > abs(v.y) ? abs(v.x) : abs(v.y);
  if (abs(v.z) > most) most = abs(v.z);
  if (!(most > 0)) return 0;
  const Vec3<T> r = v / most;
  return most * sqrt(Dot(r, r));
}

template <typename T>
struct ScreenEllipse {
  double u = 0, v = 0;          // centre, pixels
  T c00 = 1, c10 = 0, c11 = 1;  // C, pixels
  T filter = 1;                 // rho of EQ(splat-filter)

  // w of the offset d, with C w = d.
  HD void Whiten(T dx, T dy, T* w) const {
    w[0] = dx / c00;
    w[1] = (dy - c10 * w[0]) / c11;
  }
};

// See EQ(splat-filter), pixels^2.
struct SplatBlur {
  double added = 0, fitted = 0;  // s, e
};

HD inline SplatBlur BlurOf(const SplatCamera& camera, const SplatOptions& options) {
  if (options.fit_pixel < 0) return {options.blur, options.blur};
  const double r2 = camera.fx * options.fit_pixel * (camera.fy * options.fit_pixel);
  return {options.blur * (r2 > 1 ? r2 : 1), options.blur * r2};
}

// EQ(splat-projection) with what its adjoint needs.
template <typename T>
struct SplatProjection {
  Vec3d at;           // mean, camera coordinates
  bool limited[2]{};  // t_x, t_y
  Vec3<T> t;          // (t_x, t_y, 1)
  T per_z[2]{};       // fx / z, fy / z
  Vec3<T> axis[3];    // v_k
  Vec3<T> scale;
  Vec3<T> b[2];                 // rows of B
  Vec3<T> area, area_by_slope;  // n / (c00 c11), and its factor of t.v_k
  ScreenEllipse<T> ellipse;
};

// False if the splat is left out.
template <typename T>
HD bool ProjectMean(const SplatCamera& camera, const SplatOptions& options, const Vec3<T>& mean,
                    SplatProjection<T>* p) {
  using std::abs;
  p->at = camera.rotation * mean.template Cast<double>() + camera.translation;
  const double z = p->at.z;
  if (!(z >= options.near_plane)) return false;
  const double f[2] = {camera.fx, camera.fy}, c[2] = {camera.cx, camera.cy};
  const double half[2] = {camera.width * 0.5, camera.height * 0.5};
  double screen[2];
  for (int i = 0; i < 2; ++i) {
    const double slope = p->at[i] / z;
    screen[i] = f[i] * slope + c[i];
    if (!(abs(screen[i]) <= kMaxOffset)) return false;
    const double middle = (half[i] - c[i]) / f[i], most = kMaxSlope * half[i] / f[i];
    const double low = middle - most, high = middle + most;
    p->limited[i] = slope < low || slope > high;
    p->t[i] = static_cast<T>(slope < low ? low : slope > high ? high : slope);
    p->per_z[i] = static_cast<T>(f[i] / z);
  }
  p->t.z = 1;
  p->ellipse.u = screen[0];
  p->ellipse.v = screen[1];
  return true;
}

template <typename T>
HD bool ProjectSplat(const SplatCamera& camera, const SplatOptions& options,
                     const Splat<T>& splat, SplatProjection<T>* p) {
  using std::abs, std::sqrt;
  if (!ProjectMean(camera, options, splat.mean, p)) return false;
  const Mat3<T> rotation = camera.rotation.Cast<T>() * RotationOf(splat.quaternion);
  p->scale = ScalesOf(splat.log_scale);
  const SplatBlur blur = BlurOf(camera, options);
  const T root = sqrt(static_cast<T>(blur.added));
  Vec3<T> a[2];
  T most = root;
  for (int k = 0; k < 3; ++k) {
    p->axis[k] = {rotation(0, k), rotation(1, k), rotation(2, k)};
    for (int i = 0; i < 2; ++i) {
      a[i][k] = p->scale[k] * (p->per_z[i] * (p->axis[k][i] - p->t[i] * p->axis[k].z));
      most = abs(a[i][k]) > most ? abs(a[i][k]) : most;
    }
  }
  Vec3<T> n;  // over most^2
  const Vec3<T> wide = p->scale * (p->per_z[0] / most), high = p->scale * (p->per_z[1] / most);
  for (int k = 0; k < 3; ++k) {
    p->area_by_slope[k] = wide[(k + 1) % 3] * high[(k + 2) % 3];
    n[k] = p->area_by_slope[k] * Dot(p->t, p->axis[k]);
  }
  ScreenEllipse<T>* const e = &p->ellipse;
  e->c00 = ScaledNorm(Vec3<T>{ScaledNorm(a[0]), root, T(0)});
  p->b[0] = a[0] / e->c00;
  e->c10 = Dot(p->b[0], a[1]);
  e->c11 = ScaledNorm(Vec3<T>{ScaledNorm(n) * most * (most / e->c00), root,
                              root * (ScaledNorm(a[1]) / e->c00)});
  p->area = n * (most / e->c00) * (most / e->c11);
  p->area_by_slope = p->area_by_slope * (most / e->c00) * (most / e->c11);
  p->b[1] = (a[1] / e->c00) * ((root / e->c00) * (root / e->c11)) + Cross(p->area, p->b[0]);
  e->filter = 1;
  if (blur.fitted < blur.added) {
    const T part = sqrt(static_cast<T>(blur.fitted));
    const Vec3<T> sides = {ScaledNorm(a[0]) / e->c11, ScaledNorm(a[1]) / e->c11, part / e->c11};
    e->filter =
        ScaledNorm(Vec3<T>{ScaledNorm(p->area), part / e->c00 * ScaledNorm(sides), T(0)});
  }
  return true;
}

// Sums over a splat's pixels.
template <typename T>
struct EllipseSums {
  T h[2]{}, H[3]{};  // sum g w; sum g (w_0 w_0, w_0 w_1, w_1 w_1)
  T f = 0;           // sum g
};

// Adds the gradient to d; d_depth: of z. In pictures smaller than the fit's the filter counts
// as constant.
template <typename T>
HD void ProjectSplatAdjoint(const SplatCamera& camera, const SplatOptions& options,
                            const Splat<T>& splat, const SplatProjection<T>& p,
                            const EllipseSums<T>& sums, T d_depth, Splat<T>* d) {
  const ScreenEllipse<T>& e = p.ellipse;
  const T z = static_cast<T>(p.at.z);
  const T f = options.fit_pixel == 0 ? sums.f : T(0);
  const Vec3<T> r0 = p.b[0] * (sums.H[0] - f) + p.b[1] * sums.H[1];
  const Vec3<T> r1 = p.b[0] * sums.H[1] + p.b[1] * (sums.H[2] - f);
  // C^-T (r0, r1) is d_A; the gradient by J W R is that times the scales.
  const Vec3<T> g1 = r1 / e.c11, g0 = (r0 - g1 * e.c10) / e.c00;
  Vec3<T> d_log = {p.b[0].x * r0.x + p.b[1].x * r1.x, p.b[0].y * r0.y + p.b[1].y * r1.y,
                   p.b[0].z * r0.z + p.b[1].z * r1.z};
  // J's entries are per_z (1, 0, -t_x) and per_z (0, 1, -t_y).
  T d_per_z = -(d_log.x + d_log.y + d_log.z) / z;  // by z, through fx / z and fy / z
  Vec3<T> d_axis[3], d_t{};
  for (int k = 0; k < 3; ++k) {
    const T gx = p.scale[k] * g0[k] * p.per_z[0], gy = p.scale[k] * g1[k] * p.per_z[1];
    d_axis[k] = {gx, gy, -gx * p.t.x - gy * p.t.y};
    d_t += Vec3<T>{gx, gy, T(0)} * -p.axis[k].z;
  }
  const T rho = ScaledNorm(p.area);
  if (f != 0 && rho > 0) {
    for (int k = 0; k < 3; ++k) {
      const T share = p.area[k] / rho, weight = f * share * (p.area_by_slope[k] / rho);
      d_axis[k] += p.t * weight;
      d_t += p.axis[k] * weight;
      d_log[k] += f * (1 - share * share);
    }
    d_per_z -= 2 * f / z;
  }
  const T d_v = sums.h[1] / e.c11, d_u = (sums.h[0] - e.c10 * d_v) / e.c00;
  Vec3<T> d_at = {p.per_z[0] * d_u, p.per_z[1] * d_v, d_depth + d_per_z};
  const T slope[2] = {static_cast<T>(p.at.x / p.at.z), static_cast<T>(p.at.y / p.at.z)};
  for (int i = 0; i < 2; ++i) {
    d_at.z -= slope[i] * d_at[i];
    if (p.limited[i]) continue;
    d_at[i] += d_t[i] / z;
    d_at.z -= d_t[i] * slope[i] / z;
  }
  const Mat3<T> world_from_camera = camera.rotation.Transposed().Cast<T>();
  d->mean += world_from_camera * d_at;
  Mat3<T> d_rotation;
  for (int k = 0; k < 3; ++k) {
    const Vec3<T> column = world_from_camera * d_axis[k];
    for (int i = 0; i < 3; ++i) d_rotation(i, k) = column[i];
    d->log_scale[k] += d_log[k] * LogScaleCounts(splat.log_scale[k]);
  }
  RotationAdjoint(splat.quaternion, d_rotation, d->quaternion);
}

}  // namespace regrade
