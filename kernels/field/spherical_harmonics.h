// Real spherical harmonics of degree 0..2 as Cartesian polynomials, without poles or
// trigonometry.
//
// EQ(sh-basis): c(d) = max(0, sum_k sh_k Gamma_k(d) + 1/2), d a unit vector. A zero field is
// mid-grey. Constants and signs are svox2's, so that checkpoints are interchangeable.
#pragma once

#include "kernels/base/vec.h"

namespace regrade {

inline constexpr int kMaxBasis = 9;
inline constexpr double kSh0 = 0.28209479177387814;  // 1 / (2 sqrt(pi))

// Degree 0, 1, 2 have 1, 4, 9 functions.
HD constexpr int BasisOfDegree(int degree) { return (degree + 1) * (degree + 1); }

// gamma [basis]; `basis` is 1, 4 or 9; `d` has unit length (a length s would scale band l by
// s^l).
template <typename T>
HD REGRADE_ALWAYS_INLINE void ShBasis(int basis, const Vec3<T>& d, T* gamma) {
  gamma[0] = T(kSh0);
  if (basis <= 1) return;
  constexpr double kSh1 = 0.4886025119029199;
  gamma[1] = T(-kSh1) * d.y;
  gamma[2] = T(kSh1) * d.z;
  gamma[3] = T(-kSh1) * d.x;
  if (basis <= 4) return;
  constexpr double kSh2a = 1.0925484305920792, kSh2b = 0.31539156525252005,
                   kSh2c = 0.5462742152960396;
  gamma[4] = T(kSh2a) * d.x * d.y;
  gamma[5] = T(-kSh2a) * d.y * d.z;
  gamma[6] = T(kSh2b) * (T(2) * d.z * d.z - d.x * d.x - d.y * d.y);
  gamma[7] = T(-kSh2a) * d.x * d.z;
  gamma[8] = T(kSh2c) * (d.x * d.x - d.y * d.y);
}

}  // namespace regrade
