// Mean and covariance of image colours, and the eigenvalues that colour transfer needs.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/vec.h"
#include "kernels/scene/image.h"

namespace regrade {

inline constexpr Mat3d kZeroMat3d{{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}};

// Variance of rounding to 8 bits, uniform over one step of 1 / 255: a smaller variance is
// treated as no colour.
inline constexpr double kRoundingVariance = 1.0 / (255.0 * 255.0 * 12.0);

struct ColorStatistics {
  Vec3d mean{};                   // in the colour space of the measurement
  Mat3d covariance = kZeroMat3d;  // divided by n: one pixel has covariance 0
  int64_t count = 0;              // pixels
};

// EQ(color-statistics): mean m = sum c / n and covariance sum (c - m)(c - m)^T / n of sRGB
// values.
//
// Pixels are counted if their values are finite, `mask` (one channel, same size; may be null)
// is above 1/2 and the image's own alpha, if any, is above 1/2. One channel counts as R = G =
// B. Images of 8-bit values are summed in integers and rounded once; others take two passes in
// double, row by row: the result is the same for any number of threads. Throws Error(kInput)
// for a mask of another size, and "mask selects no pixel" if no pixel is counted.
ColorStatistics MeasureColor(const Image& image, const Image* mask = nullptr);

// The same in another colour space: `from_srgb` is applied to each pixel first.
ColorStatistics MeasureColor(const Image& image, Vec3d (*from_srgb)(const Vec3d&),
                             const Image* mask = nullptr);

// As if all pixels had been in one image (parallel axis theorem), in the order given. Parts
// without pixels are ignored; throws Error(kInput) if there are no pixels at all.
ColorStatistics Pool(const std::vector<ColorStatistics>& parts);

struct EigenSystem {
  Vec3d values;   // ascending
  Mat3d vectors;  // in columns, orthonormal
};

// Of (m + m^T) / 2. Non-finite values fail a check, before the solver (which would report
// success for an infinity) and after it.
EigenSystem SymmetricEigen(const Mat3d& m);

// As SymmetricEigen, for matrices that are positive semidefinite up to rounding: eigenvalues
// within 64 epsilon of the largest are exactly 0, more negative ones fail a check.
EigenSystem CovarianceEigen(const Mat3d& covariance);

}  // namespace regrade
