// A splat's rotation and scales, and their adjoint.
//
// EQ(splat-covariance), Kerbl et al. 2023, eq. 6: Sigma = R S S^T R^T, S = diag(exp(l)),
// l the logarithms of the scales, R the rotation of the unit quaternion n = q / |q|. Sigma
// itself is not formed: squares of scales would lose the thin axes of a needle.
//
// q is divided by its largest component first, so that no length under- or overflows. A q whose
// components are below kMinQuaternion has no direction: R is the identity, and d_q = 0. With
// d_n from R's entries,
//   d_q = (d_n - n <n, d_n>) / |q|.
// Logarithms beyond kMaxLogScale count as kMaxLogScale, with d_l = 0.
#pragma once

#include <cmath>

#include "kernels/base/vec.h"

namespace regrade {

inline constexpr double kMinQuaternion = 1e-30;
inline constexpr double kMaxLogScale = 50;  // of the magnitude; exp(50) is 5e21

// n [4]; returns 1 / |q|, or 0 with n of the identity.
template <typename T>
HD T UnitQuaternion(const T* q, T* n) {
  using std::abs, std::sqrt;
  T most = 0;
  for (int a = 0; a < 4; ++a) most = abs(q[a]) > most ? abs(q[a]) : most;
  if (!(most >= T(kMinQuaternion))) {
    n[0] = 1, n[1] = n[2] = n[3] = 0;
    return 0;
  }
  T square = 0;
  for (int a = 0; a < 4; ++a) n[a] = q[a] / most, square += n[a] * n[a];
  const T length = sqrt(square);
  for (int a = 0; a < 4; ++a) n[a] /= length;
  return 1 / most / length;
}

template <typename T>
HD Mat3<T> RotationOf(const T* quaternion) {
  T n[4];
  UnitQuaternion(quaternion, n);
  const T w = n[0], x = n[1], y = n[2], z = n[3];
  Mat3<T> r;
  r.row[0] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)};
  r.row[1] = {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)};
  r.row[2] = {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)};
  return r;
}

// Adds to d_quaternion [4].
template <typename T>
HD void RotationAdjoint(const T* quaternion, const Mat3<T>& d, T* d_quaternion) {
  T n[4];
  const T inverse_length = UnitQuaternion(quaternion, n);
  if (!(inverse_length > 0)) return;
  const T w = n[0], x = n[1], y = n[2], z = n[3];
  const T d_n[4] = {
      2 * (x * (d(2, 1) - d(1, 2)) + y * (d(0, 2) - d(2, 0)) + z * (d(1, 0) - d(0, 1))),
      2 * (y * (d(0, 1) + d(1, 0)) + z * (d(0, 2) + d(2, 0)) + w * (d(2, 1) - d(1, 2)) -
           2 * x * (d(1, 1) + d(2, 2))),
      2 * (x * (d(0, 1) + d(1, 0)) + z * (d(1, 2) + d(2, 1)) + w * (d(0, 2) - d(2, 0)) -
           2 * y * (d(0, 0) + d(2, 2))),
      2 * (x * (d(0, 2) + d(2, 0)) + y * (d(1, 2) + d(2, 1)) + w * (d(1, 0) - d(0, 1)) -
           2 * z * (d(0, 0) + d(1, 1)))};
  const T along = n[0] * d_n[0] + n[1] * d_n[1] + n[2] * d_n[2] + n[3] * d_n[3];
  for (int a = 0; a < 4; ++a) d_quaternion[a] += (d_n[a] - n[a] * along) * inverse_length;
}

// Standard deviations along the splat's axes.
template <typename T>
HD Vec3<T> ScalesOf(const Vec3<T>& log_scale) {
  using std::exp;
  constexpr T kMost = T(kMaxLogScale);
  Vec3<T> scale;
  for (int a = 0; a < 3; ++a) {
    const T l = log_scale[a];
    scale[a] = exp(l > kMost ? kMost : l < -kMost ? -kMost : l);
  }
  return scale;
}

// 1 where a logarithm counts as it is, 0 where it is clamped.
template <typename T>
HD T LogScaleCounts(T log_scale) {
  using std::abs;
  return abs(log_scale) <= T(kMaxLogScale) ? T(1) : T(0);
}

}  // namespace regrade
