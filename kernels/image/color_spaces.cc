#include "kernels/image/color_spaces.h"

#include <cmath>

#include "kernels/scene/srgb.h"

namespace regrade {
namespace {

// Rows X, Y, Z of linear sRGB light. White, D65, is the sum of the columns.
constexpr Mat3d kXyzFromLinear{{{0.4124564, 0.3575761, 0.1804375},
                                {0.2126729, 0.7151522, 0.0721750},
                                {0.0193339, 0.1191920, 0.9503041}}};

double White(int i) {
  const Vec3d& row = kXyzFromLinear.row[i];
  return row.x + row.y + row.z;
}

Mat3d Inverse(const Mat3d& m) {
  const Vec3d cross[3] = {Cross(m.row[1], m.row[2]), Cross(m.row[2], m.row[0]),
                          Cross(m.row[0], m.row[1])};
  Mat3d inverse;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) inverse(i, j) = cross[j][i] / m.Determinant();
  return inverse;
}

// The curve on positive values, continued as an odd function; NaN stays NaN.
template <typename Curve>
Vec3d Odd(const Curve& curve, const Vec3d& v) {
  Vec3d result;
  for (int c = 0; c < 3; ++c)
    result[c] = v[c] > 0 ? curve(v[c]) : v[c] < 0 ? -curve(-v[c]) : v[c];
  return result;
}

constexpr double kDelta = 6.0 / 29;

double LabCurve(double t) {
  return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3 * kDelta * kDelta) + 4.0 / 29;
}

double InverseLabCurve(double f) {
  return f > kDelta ? f * f * f : 3 * kDelta * kDelta * (f - 4.0 / 29);
}

}  // namespace

Vec3d LinearFromSrgb(const Vec3d& srgb) {
  return Odd([](double v) { return LinearFromSrgb(v); }, srgb);
}

Vec3d SrgbFromLinear(const Vec3d& linear) {
  return Odd([](double v) { return SrgbFromLinear(v); }, linear);
}

Vec3d XyzFromLinear(const Vec3d& linear) { return kXyzFromLinear * linear; }

Vec3d LinearFromXyz(const Vec3d& xyz) {
  static const Mat3d linear_from_xyz = Inverse(kXyzFromLinear);
  return linear_from_xyz * xyz;
}

Vec3d LabFromSrgb(const Vec3d& srgb) { return LabFromLinear(LinearFromSrgb(srgb)); }

Vec3d LabFromLinear(const Vec3d& linear) {
  const Vec3d xyz = XyzFromLinear(linear);
  const double fx = LabCurve(xyz.x / White(0)), fy = LabCurve(xyz.y / White(1)),
               fz = LabCurve(xyz.z / White(2));
  return {116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)};
}

Vec3d SrgbFromLab(const Vec3d& lab) {
  const double fy = (lab.x + 16) / 116;
  const double fx = fy + lab.y / 500, fz = fy - lab.z / 200;
  return SrgbFromLinear(
      LinearFromXyz({White(0) * InverseLabCurve(fx), White(1) * InverseLabCurve(fy),
                     White(2) * InverseLabCurve(fz)}));
}

}  // namespace regrade
