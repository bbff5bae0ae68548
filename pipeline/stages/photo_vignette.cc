#include "pipeline/stages/photo_vignette.h"

#include <algorithm>
#include <cmath>

namespace regrade {
namespace {

constexpr double kLeastVignette = 0.03;
constexpr double kVignetteExplains = 0.5;

}  // namespace

double SquaredRadius(const Image& image, int64_t i) {
  const double x = static_cast<double>(i % image.width) + 0.5 - 0.5 * image.width;
  const double y = static_cast<double>(i / image.width) + 0.5 - 0.5 * image.height;
  return (x * x + y * y) * 4 /
         (static_cast<double>(image.width) * image.width +
          static_cast<double>(image.height) * image.height);
}

Rings MeasureRings(const Image& mapped, const Image& edited) {
  Rings rings;
  for (int64_t i = 0; i < mapped.num_pixels(); ++i) {
    const double r = std::sqrt(SquaredRadius(mapped, i));
    const int k = std::min(kRings - 1, static_cast<int>(r * kRings));
    const Vec3d m = ColorAt(mapped, i), e = ColorAt(edited, i);
    rings.product[k] += Dot(m, e);
    rings.square[k] += Dot(m, m);
  }
  return rings;
}

// Least squares over the rings, weighted by their light.
Vignette FitVignette(const Rings& rings) {
  // Factors are c (1 + a r^2 + b r^4): linear in c, c a and c b.
  double gram[3][3] = {}, right[3] = {};
  for (int k = 0; k < kRings; ++k) {
    const double r = (k + 0.5) / kRings, s = r * r;
    const double x[3] = {1, s, s * s};
    for (int i = 0; i < 3; ++i) {
      right[i] += rings.square[k] * x[i] * rings.Factor(k);
      for (int j = 0; j < 3; ++j) gram[i][j] += rings.square[k] * x[i] * x[j];
    }
  }
  Mat3d m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m(i, j) = gram[i][j];
  const double determinant = m.Determinant();
  if (!(std::abs(determinant) > 1e-12 * std::pow(gram[0][0], 3))) return {};
  Vec3d solution;
  for (int c = 0; c < 3; ++c) {
    Mat3d replaced = m;
    for (int i = 0; i < 3; ++i) replaced(i, c) = right[i];
    solution[c] = replaced.Determinant() / determinant;
  }
  if (!(solution.x > 0.2)) return {};
  const Vignette vignette{solution.y / solution.x, solution.z / solution.x};
  for (double s = 0; s <= 1; s += 0.05)
    if (!(vignette(s) > 0.05)) return {};
  return vignette;
}

bool IsVignette(const Rings& rings, const Vignette& vignette, double left,
                double left_without) {
  const double centre = rings.Factor(1), half = rings.Factor(kRings / 2),
               corner = rings.Factor(kRings - 3);
  return std::abs(vignette(1) - 1) >= kLeastVignette &&
         left < kVignetteExplains * left_without &&
         std::abs(corner - half) > std::abs(half - centre);
}

void PutVignette(const Vignette& vignette, Image* image) {
  if (vignette.a == 0 && vignette.b == 0) return;
  for (int64_t i = 0; i < image->num_pixels(); ++i) {
    const auto factor = static_cast<float>(vignette(SquaredRadius(*image, i)));
    for (int c = 0; c < 3; ++c) {
      float& value = image->pixels[static_cast<size_t>(3 * i + c)];
      value = std::min(1.0f, value * factor);
    }
  }
}

}  // namespace regrade
