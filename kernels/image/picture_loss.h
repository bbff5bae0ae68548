// How far a rendered picture is from a photo, and the gradient by the picture.
//
// EQ(picture-loss), Kerbl et al. 2023, eq. 7: over the pixels and channels of a picture x and a
// photo y,
//   L = (1 - lambda) mean |x - y| + lambda (1 - mean S),   S = A B / (C D),
//   A = 2 m_x m_y + C1,        C = m_x^2 + m_y^2 + C1,     m_x = G x,  m_y = G y,
//   B = 2 (G xy - m_x m_y) + C2,   D = G x^2 - m_x^2 + G y^2 - m_y^2 + C2,
// with the windows G (11 x 11, sigma 1.5) and the constants of EQ(ssim). Beyond the border, and
// where a pixel of the photo is masked, both pictures are 0, and S counts there as elsewhere.
//
// EQ(picture-loss-adjoint): with P = G x, Q = G x^2, R = G xy,
//   dS/dQ = -S / D,  dS/dR = 2 A / (C D),
//   dS/dP = 2 m_y (B - A) / (C D) - 2 P S (1 / C - 1 / D);   G is symmetric, so that
//   d_x mean S = (G dS/dP + 2 x G dS/dQ + y G dS/dR) / (3 pixels).
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/host_device.h"

namespace regrade {

inline constexpr int kSsimReach = 5;  // pixels from a window's middle to its side
inline constexpr double kSsimSigma = 1.5, kSsimC1 = 1e-4, kSsimC2 = 9e-4;

// The window along one axis, [2 kSsimReach + 1], of sum 1.
template <typename T>
std::vector<T> SsimTaps();

// S and its derivatives at a pixel and channel, by P, Q and R.
template <typename T>
struct SsimSlopes {
  T s, by_p, by_q, by_r;
};

template <typename T>
HD REGRADE_ALWAYS_INLINE SsimSlopes<T> SsimOf(T p, T q, T r, T m_y, T square_y) {
  const T a = 2 * p * m_y + T(kSsimC1), c = p * p + m_y * m_y + T(kSsimC1);
  const T b = 2 * (r - p * m_y) + T(kSsimC2);
  const T d = q - p * p + square_y - m_y * m_y + T(kSsimC2);
  const T per = 1 / (c * d), s = a * b * per;
  return {s, 2 * m_y * (b - a) * per - 2 * p * s * (1 / c - 1 / d), -s / d, 2 * a * per};
}

// Sums over pixels and channels that are not masked, but of S over all.
struct PictureSums {
  double absolute = 0, squared = 0, similarity = 0;
  int64_t values = 0;  // not masked
};

// The plain version. `photo`, `picture` and `d_picture` have shape [H, W, 3], sRGB; a pixel of
// the photo with a channel that is not finite is masked. Writes d_picture, the gradient of L,
// where means are over all 3 H W values.
template <typename T>
PictureSums ComparePlain(int width, int height, const T* photo, const T* picture, T lambda,
                         T* d_picture);

// Workspace of the fast version, kept between calls.
struct LossRows {
  std::vector<float> photo, picture, by_p, by_q, by_r;  // [H, 3 W + margins]
};

// As ComparePlain, by bands of rows in parallel; the same bits for any number of threads. The
// photo [H, W, 3] is in steps of 1 / 65535; masked [H, W]: not 0 where a pixel is; null: none.
PictureSums Compare(int width, int height, const uint16_t* photo, const uint8_t* masked,
                    const float* picture, float lambda, LossRows* rows, float* d_picture);

}  // namespace regrade
