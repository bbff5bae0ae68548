// The vignette of an edited photo, fitted ring by ring; see EQ(photo-edit).
#pragma once

#include <cstdint>

#include "kernels/base/vec.h"
#include "kernels/scene/image.h"
#include "pipeline/run/vignette.h"

namespace regrade {

inline constexpr int kRings = 32;  // of equal width, from the centre to a corner

inline Vec3d ColorAt(const Image& image, int64_t i) {
  const float* p = &image.pixels[static_cast<size_t>(3 * i)];
  return {p[0], p[1], p[2]};
}

// In half diagonals from the centre.
double SquaredRadius(const Image& image, int64_t i);

// Factor of each ring by which the mapped photo is brighter or darker than the edit.
struct Rings {
  double product[kRings] = {}, square[kRings] = {};
  double Factor(int k) const { return square[k] > 0 ? product[k] / square[k] : 1; }
};

Rings MeasureRings(const Image& mapped, const Image& edited);

// Least squares over the rings, weighted by their light; none where that has no sense.
Vignette FitVignette(const Rings& rings);

// Whether it is one: `left` is the mean square that the edit's map of colours leaves with it,
// `left_without` without.
bool IsVignette(const Rings& rings, const Vignette& vignette, double left, double left_without);

// Multiplies a picture [H, W, 3] by it, clipped to 1.
void PutVignette(const Vignette& vignette, Image* image);

}  // namespace regrade
