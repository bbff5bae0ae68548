// exp(-tau) and 1 - exp(-tau) of many samples at once; compiled once per instruction set.
//
// With n = round(-tau / ln 2), r = -tau - n ln 2 in [-0.35, 0.35] and e = expm1(r) by its
// Taylor series to the seventh degree (remainder below 1.5e-8 e):
//   exp(-tau) = 2^n + 2^n e,   1 - exp(-tau) = (1 - 2^n) - 2^n e.
// A small tau has n = 0, so its opacity is -e with full relative accuracy.
#pragma once

#include "kernels/field/cpu/vector_simd.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

struct Extinction {
  Wide alpha;  // 1 - exp(-tau)
  Wide decay;  // exp(-tau); 0 beyond 87, where 2^n would be subnormal
};

// `tau` must not be negative or NaN.
inline Extinction Extinguish(Wide tau) {
  constexpr float kFarthest = 87.0f;
  const Wide near = tau < Fill(kFarthest) ? tau : Fill(kFarthest);
  // Adding 1.5 * 2^23 puts the nearest integer in a float's lowest bits.
  constexpr float kRound = 12582912.0f;
  constexpr int32_t kRoundBits = 0x4B400000;
  const Wide rounded = near * -1.4426950408889634f + kRound;
  const Wide n = rounded - kRound;
  // ln 2 in two parts: the first has so few bits that its products with n are exact.
  const Wide r = (-near - n * 0.693359375f) + n * 2.12194440e-4f;
  Wide series = r * (1.0f / 5040) + 1.0f / 720;
  series = series * r + 1.0f / 120;
  series = series * r + 1.0f / 24;
  series = series * r + 1.0f / 6;
  series = series * r + 0.5f;
  const Wide e = r + r * r * series;
  const WideInt exponent = reinterpret_cast<WideInt>(rounded) - (kRoundBits - 127);
  const Wide scale = reinterpret_cast<Wide>(exponent << 23);
  const Wide scaled = scale * e;
  Extinction result;
  result.alpha = (1.0f - scale) - scaled;
  result.decay = tau < Fill(kFarthest) ? scale + scaled : Wide{};
  return result;
}

}  // namespace
}  // namespace regrade::REGRADE_SIMD_NAMESPACE
