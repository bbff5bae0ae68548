#include "kernels/splats/rotate_harmonics.h"

#include <cmath>

namespace regrade {

HarmonicsMatrix RotateHarmonics(const Mat3d& rotation) {
  // Roots and weights of the Legendre polynomial of degree 4 on [-1, 1].
  const double inner = std::sqrt((3 - 2 * std::sqrt(1.2)) / 7),
               outer = std::sqrt((3 + 2 * std::sqrt(1.2)) / 7),
               of_inner = (18 + std::sqrt(30.0)) / 36, of_outer = (18 - std::sqrt(30.0)) / 36;
  const double root[] = {-outer, -inner, inner, outer},
               weight[] = {of_outer, of_inner, of_inner, of_outer};
  constexpr int kAround = 8;
  const Mat3d back = rotation.Transposed();
  HarmonicsMatrix matrix{};
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < kAround; ++k) {
      const double across = std::sqrt(1 - root[i] * root[i]), angle = 2 * M_PI * k / kAround;
      const Vec3d direction{across * std::cos(angle), across * std::sin(angle), root[i]};
      double to[kMaxBasis], from[kMaxBasis];
      ShBasis(kMaxBasis, direction, to);
      ShBasis(kMaxBasis, back * direction, from);
      for (size_t a = 0; a < kMaxBasis; ++a)
        for (size_t b = 0; b < kMaxBasis; ++b)
          matrix[a][b] += weight[i] * 2 * M_PI / kAround * to[a] * from[b];
    }
  // The sums are accurate to 1e-15.
  for (auto& row : matrix)
    for (double& entry : row)
      if (std::abs(entry - std::round(entry)) < 1e-14) entry = std::round(entry);
  return matrix;
}

}  // namespace regrade
