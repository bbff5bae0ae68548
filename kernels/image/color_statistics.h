// Mean and covariance of the colours of pictures, and the eigenvalues that colour transfer
// needs of them.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/vec.h"
#include "kernels/scene/image.h"

namespace regrade {

inline constexpr Mat3d kZeroMat3d{{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}};

// Variance of rounding to 8 bits, uniform over one step of 1 / 255: less than this is no
// colour.
inline constexpr double kRoundingVariance = 1.0 / (255.0 * 255.0 * 12.0);

struct ColorStatistics {
  Vec3d mean{};                   // units of the space the pictures were measured in
  Mat3d covariance = kZeroMat3d;  // divided by n: one pixel has covariance 0
  int64_t count = 0;              // pixels
};

// EQ(color-statistics): mean m = sum c / n and covariance sum (c - m)(c - m)^T / n of sRGB
// values.
//
// Counted are pixels with finite values, where `mask` (one channel, same size; may be null) is
// above 1/2 and where the picture's own alpha, if any, is. One channel counts as R = G = B.
// Pictures of 8-bit values are summed in integers and rounded once; others take two passes in
// double, row by row: the same bits for any number of threads. Throws Error(kInput) for a mask
// of another size, and "mask selects no pixel" when nothing is left to count.
ColorStatistics MeasureColor(const Image& image, const Image* mask = nullptr);

// The same in another space: `from_srgb` is applied to each pixel first.
ColorStatistics MeasureColor(const Image& image, Vec3d (*from_srgb)(const Vec3d&),
                             const Image* mask = nullptr);

// As if all pixels had been in one picture (parallel axis theorem), in the order given. Parts
// without pixels have no say; throws Error(kInput) if none has any.
ColorStatistics Pool(const std::vector<ColorStatistics>& parts);

struct EigenSystem {
  Vec3d values;   // ascending
  Mat3d vectors;  // in columns, orthonormal
};

// Of (m + m^T) / 2. Values that are not finite fail a check before the solver, which would take
// an infinity for success, and after it.
EigenSystem SymmetricEigen(const Mat3d& m);

// As SymmetricEigen, for matrices that are positive semidefinite but for rounding: eigenvalues
// within 64 epsilon of the largest are exactly 0, more negative ones fail a check.
EigenSystem CovarianceEigen(const Mat3d& covariance);

}  // namespace regrade
