// An appearance with more spherical harmonics, or fewer.
#pragma once

#include <algorithm>
#include <utility>

#include "kernels/field/radiance_field.h"

namespace regrade {

// The same colours with `basis` harmonics per channel; the added coefficients are 0, and
// renders are bit-identical. Returns the input unchanged if it already has that many.
inline Appearance PadShBasis(Appearance appearance, int basis) {
  const int own = appearance.basis;
  if (own >= basis) return appearance;
  const int64_t rows = appearance.sh.size() / own;
  Buffer<float> sh(rows * basis);  // zero
  for (int64_t i = 0; i < rows; ++i)
    std::copy_n(appearance.sh.data() + i * own, own, sh.data() + i * basis);
  appearance.basis = basis;
  appearance.sh = std::move(sh);
  return appearance;
}

// With at most `basis` harmonics per channel; higher ones are left out.
inline Appearance LimitShBasis(Appearance appearance, int basis) {
  const int own = appearance.basis;
  if (own <= basis) return appearance;
  const int64_t rows = appearance.sh.size() / own;
  Buffer<float> sh(rows * basis);
  for (int64_t i = 0; i < rows; ++i)
    std::copy_n(appearance.sh.data() + i * own, basis, sh.data() + i * basis);
  appearance.basis = basis;
  appearance.sh = std::move(sh);
  return appearance;
}

}  // namespace regrade
