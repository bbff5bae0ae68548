// Linear maps of colours: fitted, measured, and carried into spherical-harmonic coefficients.
#pragma once

#include "kernels/base/vec.h"
#include "kernels/field/radiance_field.h"
#include "kernels/field/spherical_harmonics.h"

namespace regrade {

// c -> matrix c + offset, sRGB values.
struct ColorMap {
  Mat3d matrix;  // the identity
  Vec3d offset{};

  Vec3d operator()(const Vec3d& c) const { return matrix * c + offset; }
};

// EQ(sh-color-map), LipRF Lemma 2: with c(d) = sum_k sh_k Gamma_k(d) + v, v = 1/2, the field of
// A c + b has the coefficients A sh_k, and A sh_0 + (A v + b - v) / Gamma_0 for k = 0, Gamma_0
// = 1 / (2 sqrt(pi)). Exact where the colour clamp is not active.
//
// `sh` and `mapped` are one voxel's [3, basis], channel-major; they may be the same.
template <typename T>
void MapCoefficients(const ColorMap& map, int basis, const T* sh, T* mapped) {
  const Vec3d v{0.5, 0.5, 0.5};
  const Vec3d shift = (map(v) - v) / kSh0;
  for (int k = 0; k < basis; ++k) {
    Vec3d value =
        map.matrix * Vec3<T>{sh[k], sh[basis + k], sh[2 * basis + k]}.template Cast<double>();
    if (k == 0) value += shift;
    for (int c = 0; c < 3; ++c) mapped[c * basis + k] = static_cast<T>(value[c]);
  }
}

// Every voxel's coefficients, and every background texel's colour. A constant background colour
// is no coefficient: it stays, as in the paper.
Appearance ApplyColorMap(const Appearance& appearance, const ColorMap& map);

// That constant colour mapped all the same, and clipped as pictures are.
Vec3f MapBackground(const ColorMap& map, const Vec3f& background);

// Largest singular value, ||m||_2.
double SpectralNorm(const Mat3d& m);

// EQ(least-squares-color-map): A and b that minimise sum_j w_j |A s_j + o_j b - t_j|^2 over the
// samples added: s a source colour, t its target, and o the opacity that the offset is seen
// through, 1 for pixels of pictures.
class LeastSquaresAccumulator {
 public:
  // `weight` >= 0; values must be finite.
  void Add(const Vec3d& source, const Vec3d& target, double weight = 1, double opacity = 1);
  LeastSquaresAccumulator& operator+=(const LeastSquaresAccumulator& o);

  // Where the sources do not span the colours (grey, one colour, nothing), the smallest
  // solution; a zero map without samples.
  ColorMap Solve() const;

 private:
  double gram_[4][4] = {};   // x x^T, x = (s, o)
  double right_[4][3] = {};  // x t^T
};

}  // namespace regrade
