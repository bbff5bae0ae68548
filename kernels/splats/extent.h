// A splat's opacity, see EQ(splat-opacity), and the part of the screen where it is seen.
//
// EQ(splat-extent): seen where q = d^T S^-1 d <= Q = 2 (ln(o rho) + ln 255). The largest |d_x|
// with q <= Q is where S^-1 d is along x, d = S e_x m: q = m^2 S_xx = Q and d_x = m S_xx, so
//   |d_x| <= sqrt(Q S_xx),  |d_y| <= sqrt(Q S_yy),  S_xx = c00^2,  S_yy = c10^2 + c11^2,
// both of which are reached. The rule compares q with Q, so that what is outside needs no exp.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/splats/projection.h"

namespace regrade {

// ln(1 / (1 + exp(-x))).
template <typename T>
HD T LogSigmoid(T x) {
  using std::exp, std::log1p;
  return x < 0 ? x - log1p(exp(x)) : -log1p(exp(-x));
}

// 1 / (1 + exp(x)), the derivative of LogSigmoid.
template <typename T>
HD T LogSigmoidDerivative(T x) {
  using std::exp;
  if (x < 0) return 1 / (1 + exp(x));
  const T e = exp(-x);
  return e / (1 + e);
}

// Q of EQ(splat-extent) and ln(o rho). False if no pixel can see the splat.
template <typename T>
HD bool SplatReach(T opacity_logit, T filter, T* log_opacity, T* reach) {
  using std::log;
  if (!(filter > T(0.003))) return false;  // o <= 1
  *log_opacity = LogSigmoid(opacity_logit) + log(filter);
  if (!(*log_opacity >= T(kLogMinAlpha))) return false;
  *reach = 2 * (*log_opacity - T(kLogMinAlpha));
  return true;
}

// Columns [x0, x1) and rows [y0, y1) of pixels.
struct PixelBox {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  HD bool empty() const { return x0 >= x1 || y0 >= y1; }
};

// The pixels whose centres are within `half` of `center`, of `size` pixels.
HD inline void PixelsWithin(double center, double half, int size, int* first, int* end) {
  using std::ceil, std::floor;
  const double low = ceil(center - half - 0.5), high = floor(center + half - 0.5) + 1;
  *first = low < 0 ? 0 : low < size ? static_cast<int>(low) : size;
  *end = high < 0 ? 0 : high < size ? static_cast<int>(high) : size;
}

// All pixels that can see the splat; wider than the ellipse by kExtentMargin, for rounding.
inline constexpr double kExtentMargin = 1e-5;  // relative

template <typename T>
HD PixelBox ExtentOf(const SplatCamera& camera, const ScreenEllipse<T>& ellipse, T reach) {
  using std::sqrt;
  const double radius = sqrt(static_cast<double>(reach)) * (1 + kExtentMargin) + kExtentMargin;
  PixelBox box;
  PixelsWithin(ellipse.u, radius * ellipse.c00, camera.width, &box.x0, &box.x1);
  const double c10 = ellipse.c10, c11 = ellipse.c11;
  PixelsWithin(ellipse.v, radius * sqrt(c10 * c10 + c11 * c11), camera.height, &box.y0,
               &box.y1);
  return box;
}

}  // namespace regrade
