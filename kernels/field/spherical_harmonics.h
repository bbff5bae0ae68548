// Real spherical harmonics of degree 0..3 as Cartesian polynomials, without poles or
// trigonometry.
//
// EQ(sh-basis): c(d) = max(0, sum_k sh_k Gamma_k(d) + 1/2), d a unit vector. A zero field is
// mid-grey. Constants and signs are svox2's, so that checkpoints are interchangeable; they are
// those of harmonics with the Condon-Shortley phase, k = l (l + 1) + m.
#pragma once

#include "kernels/base/vec.h"

namespace regrade {

inline constexpr int kMaxBasis = 16;
inline constexpr int kMaxVoxelBasis = 9;             // records of voxels have no room for more
inline constexpr double kSh0 = 0.28209479177387814;  // 1 / (2 sqrt(pi))
inline constexpr double kSh1 = 0.4886025119029199;
inline constexpr double kSh2a = 1.0925484305920792, kSh2b = 0.31539156525252005,
                        kSh2c = 0.5462742152960396;
inline constexpr double kSh3a = 0.5900435899266435, kSh3b = 2.890611442640554,
                        kSh3c = 0.4570457994644658, kSh3d = 0.3731763325901154,
                        kSh3e = 1.445305721320277;

// Degree 0, 1, 2, 3 have 1, 4, 9, 16 functions.
HD constexpr int BasisOfDegree(int degree) { return (degree + 1) * (degree + 1); }

constexpr bool IsBasis(int basis) {
  return basis == 1 || basis == 4 || basis == 9 || basis == kMaxBasis;
}

// gamma [basis]; see IsBasis; `d` has unit length (a length s would scale band l by
// s^l).
template <typename T>
HD REGRADE_ALWAYS_INLINE void ShBasis(int basis, const Vec3<T>& d, T* gamma) {
  gamma[0] = T(kSh0);
  if (basis <= 1) return;
  gamma[1] = T(-kSh1) * d.y;
  gamma[2] = T(kSh1) * d.z;
  gamma[3] = T(-kSh1) * d.x;
  if (basis <= 4) return;
  gamma[4] = T(kSh2a) * d.x * d.y;
  gamma[5] = T(-kSh2a) * d.y * d.z;
  gamma[6] = T(kSh2b) * (T(2) * d.z * d.z - d.x * d.x - d.y * d.y);
  gamma[7] = T(-kSh2a) * d.x * d.z;
  gamma[8] = T(kSh2c) * (d.x * d.x - d.y * d.y);
  if (basis <= 9) return;
  const T xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
  gamma[9] = T(-kSh3a) * d.y * (T(3) * xx - yy);
  gamma[10] = T(kSh3b) * d.x * d.y * d.z;
  gamma[11] = T(-kSh3c) * d.y * (T(4) * zz - xx - yy);
  gamma[12] = T(kSh3d) * d.z * (T(2) * zz - T(3) * (xx + yy));
  gamma[13] = T(-kSh3c) * d.x * (T(4) * zz - xx - yy);
  gamma[14] = T(kSh3e) * d.z * (xx - yy);
  gamma[15] = T(-kSh3a) * d.x * (xx - T(3) * yy);
}

// The gradient by d of sum_k d_gamma_k Gamma_k(d), of the polynomials in x, y and z as free
// variables.
template <typename T>
HD Vec3<T> ShBasisAdjoint(int basis, const Vec3<T>& d, const T* d_gamma) {
  Vec3<T> g{};
  if (basis <= 1) return g;
  const T* const k = d_gamma;
  g += Vec3<T>{-k[3], -k[1], k[2]} * T(kSh1);
  if (basis <= 4) return g;
  g += Vec3<T>{d.y * k[4] - d.z * k[7], d.x * k[4] - d.z * k[5], -d.y * k[5] - d.x * k[7]} *
       T(kSh2a);
  g += Vec3<T>{-d.x, -d.y, T(2) * d.z} * (T(2 * kSh2b) * k[6]);
  g += Vec3<T>{d.x, -d.y, T(0)} * (T(2 * kSh2c) * k[8]);
  if (basis <= 9) return g;
  const T xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
  const T xy = d.x * d.y, yz = d.y * d.z, xz = d.x * d.z;
  g += Vec3<T>{T(-2) * xy, yy - xx, T(0)} * (T(3 * kSh3a) * k[9]);
  g += Vec3<T>{yz, xz, xy} * (T(kSh3b) * k[10]);
  g += Vec3<T>{T(2) * xy, xx + T(3) * yy - T(4) * zz, T(-8) * yz} * (T(kSh3c) * k[11]);
  g += Vec3<T>{T(-2) * xz, T(-2) * yz, T(2) * zz - xx - yy} * (T(3 * kSh3d) * k[12]);
  g += Vec3<T>{T(3) * xx + yy - T(4) * zz, T(2) * xy, T(-8) * xz} * (T(kSh3c) * k[13]);
  g += Vec3<T>{T(2) * xz, T(-2) * yz, xx - yy} * (T(kSh3e) * k[14]);
  g += Vec3<T>{yy - xx, T(2) * xy, T(0)} * (T(3 * kSh3a) * k[15]);
  return g;
}

}  // namespace regrade
