#include "pipeline/capture/rigid_matrix.h"

#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

constexpr double kRigidTolerance = 1e-2;  // of R^T R against 1: files round to a few digits

// The nearest rotation, by Newton's iteration on R (R^T R)^-1/2.
Mat3d Orthonormal(Mat3d r) {
  for (int i = 0; i < 4; ++i) {
    const Mat3d gram = r.Transposed() * r;
    Mat3d correction;
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) correction(a, b) = (a == b ? 1.5 : 0.0) - 0.5 * gram(a, b);
    r = r * correction;
  }
  return r;
}

}  // namespace

std::optional<RigidTransform> RigidFromRows(const double* rows) {
  RigidTransform transform;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) {
      const double value = rows[4 * i + j];
      if (!std::isfinite(value)) return std::nullopt;
      if (j < 3)
        transform.rotation(i, j) = value;
      else
        transform.translation[i] = value;
    }
  const Mat3d gram = transform.rotation.Transposed() * transform.rotation;
  double off = 0;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) off = std::max(off, std::abs(gram(a, b) - (a == b)));
  if (!(off < kRigidTolerance) || !(transform.rotation.Determinant() > 0)) return std::nullopt;
  transform.rotation = Orthonormal(transform.rotation);
  return transform;
}

}  // namespace regrade
