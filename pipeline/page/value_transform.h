// The orthogonal transform that decorrelates a splat's colour coefficients before they are
// rounded.
//
// Of all orthogonal transforms the Karhunen-Loeve transform, the eigenvectors of the
// covariance, needs the fewest bits at one rounding error, and an orthogonal transform leaves
// the error's sum of squares as it is. It is found for differences between neighbouring splats,
// which are what is stored.
#pragma once

#include <vector>

namespace regrade {

// matrix [channels, channels]: coefficients = transposed(matrix) * stored values.
struct ValueTransform {
  int channels = 0;
  std::vector<double> matrix;
};

// `difference` [n, channels]; the identity for n = 0. Entries are multiples of 1e-6.
ValueTransform DecorrelatingTransform(const std::vector<float>& difference, int channels);

}  // namespace regrade
