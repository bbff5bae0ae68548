#include "evaluate/hue_chroma.h"

#include <algorithm>
#include <cmath>

#include "evaluate/row_sum.h"
#include "kernels/base/vec.h"

namespace regrade {
namespace {

double Linear(double encoded) {
  const double v = std::clamp(encoded, 0.0, 1.0);
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

double LabCurve(double t) {
  constexpr double kDelta = 6.0 / 29;
  return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3 * kDelta * kDelta) + 4.0 / 29;
}

// CIELAB a and b. Rows of the sRGB matrix are divided by their sums, so white is (1, 1, 1) and
// grey has no chroma to the last bits.
void LabAb(const float* rgb, double* a, double* b) {
  const Vec3d linear{Linear(rgb[0]), Linear(rgb[1]), Linear(rgb[2])};
  const auto curve = [&](const Vec3d& row) {
    return LabCurve(Dot(row, linear) / (row.x + row.y + row.z));
  };
  const double x = curve({0.4124564, 0.3575761, 0.1804375});
  const double y = curve({0.2126729, 0.7151522, 0.0721750});
  const double z = curve({0.0193339, 0.1191920, 0.9503041});
  *a = 500 * (x - y);
  *b = 200 * (y - z);
}

}  // namespace

HueChroma& HueChroma::operator+=(const HueChroma& o) {
  sum_a_ += o.sum_a_;
  sum_b_ += o.sum_b_;
  sum_chroma_ += o.sum_chroma_;
  count_ += o.count_;
  return *this;
}

void HueChroma::Add(const Image& image) {
  *this += SumOverRows(image.height, [&](int y) {
    HueChroma row;
    for (int x = 0; x < image.width; ++x) {
      const float* p = image.at(x, y);
      double a = 0, b = 0;
      if (image.channels >= 3) {
        if (!AllFinite(Vec3f{p[0], p[1], p[2]})) continue;
        LabAb(p, &a, &b);
      }
      row.sum_a_ += a;
      row.sum_b_ += b;
      row.sum_chroma_ += std::hypot(a, b);
      ++row.count_;
    }
    return row;
  });
}

std::optional<double> HueChroma::MeanChroma() const {
  if (count_ == 0) return std::nullopt;
  return sum_chroma_ / static_cast<double>(count_);
}

std::optional<double> HueChroma::HueStd() const {
  if (count_ == 0 || !(*MeanChroma() >= 1e-4)) return std::nullopt;
  const double r = std::min(1.0, std::hypot(sum_a_, sum_b_) / sum_chroma_);
  return std::sqrt(-2 * std::log(std::max(r, 1e-12)));  // hues that cancel: finite, 7.4
}

}  // namespace regrade
