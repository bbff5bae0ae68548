// Spherical harmonics of a turned scene.
//
// EQ(rotate-harmonics): coefficients s'_i = sum_j M_ij s_j give the turned function,
// sum_i s'_i Gamma_i(d) = sum_j s_j Gamma_j(R^T d), with M_ij the integral of Gamma_i(d)
// Gamma_j(R^T d) over the sphere, for the Gamma are orthonormal. M is orthogonal and mixes no
// degrees. Here by a product rule of 4 x 8 points, which is exact to degree 7: harmonics of
// degree 3 need 6. Whole entries are exact: those of the identity and of half turns about an
// axis, which only change signs.
#pragma once

#include <array>

#include "kernels/base/vec.h"
#include "kernels/field/spherical_harmonics.h"

namespace regrade {

using HarmonicsMatrix = std::array<std::array<double, kMaxBasis>, kMaxBasis>;

// M of `rotation` R, for 16 coefficients; the first 1, 4 or 9 rows and columns are those of
// lower degrees.
HarmonicsMatrix RotateHarmonics(const Mat3d& rotation);

}  // namespace regrade
