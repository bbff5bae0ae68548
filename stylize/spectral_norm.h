// The largest singular value of a matrix of any size, by Jacobi's method. For 3 x 3 see
// linear_map.h.
#pragma once

#include <vector>

namespace regrade {

// `matrix` is [rows, columns], row by row.
double SpectralNorm(const std::vector<double>& matrix, int rows, int columns);

}  // namespace regrade
