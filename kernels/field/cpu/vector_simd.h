// The vectors of one instruction set, and operations on them that plain arithmetic lacks;
// compiled once per instruction set.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "kernels/field/cpu/rays.h"

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

// Floats in the widest register. Wider vector types also compile, but the compiler splits their
// shuffles and selections into lanes.
#if defined(__AVX512F__)
constexpr int kWide = 16;
#elif defined(__AVX2__)
constexpr int kWide = 8;
#else
constexpr int kWide = 4;
#endif
typedef float Wide __attribute__((vector_size(kWide * sizeof(float))));
typedef int32_t WideInt __attribute__((vector_size(kWide * sizeof(float))));
typedef float Quad __attribute__((vector_size(16)));

inline Wide Fill(float value) { return Wide{} + value; }

// 0, 1, 2, ...
inline Wide Ramp() {
#if defined(__AVX512F__)
  return Wide{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
#elif defined(__AVX2__)
  return Wide{0, 1, 2, 3, 4, 5, 6, 7};
#else
  return Wide{0, 1, 2, 3};
#endif
}

// Whether a lane of `mask`, of zeros and -1, is not zero.
inline bool AnyOf(const WideInt& mask) {
#if defined(__AVX512F__)
  __m512i lanes;
  std::memcpy(&lanes, &mask, sizeof(lanes));
  return _mm512_test_epi32_mask(lanes, lanes) != 0;
#elif defined(__AVX2__)
  __m256i lanes;
  std::memcpy(&lanes, &mask, sizeof(lanes));
  return _mm256_testz_si256(lanes, lanes) == 0;
#else
  int32_t any = 0;
  for (int l = 0; l < kWide; ++l) any |= mask[l];
  return any != 0;
#endif
}

// first[l] and second[l]: the densities at vertex at[l] and at its neighbour along z. One load
// of four words has both, with their links in between.
inline void GatherDensities(const Probe* base, const int32_t* at, Wide* first, Wide* second) {
  const auto probes = [&](int l) {
    Quad words;
    std::memcpy(&words, base + at[l], sizeof(words));
    return words;
  };
#if defined(__AVX512F__)
  const auto four = [&](int a, int b, int c, int d) {
    const auto join = [](Quad low, Quad high) {
      return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
    };
    return __builtin_shufflevector(join(probes(a), probes(b)), join(probes(c), probes(d)), 0, 1,
                                   2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  };
  // Within four lanes: d0 of two vertices, then d1 of the same two.
  const auto densities = [](Wide p, Wide q) {
    return __builtin_shufflevector(p, q, 0, 16, 2, 18, 4, 20, 6, 22, 8, 24, 10, 26, 12, 28, 14,
                                   30);
  };
  const Wide pairs = densities(four(0, 4, 8, 12), four(1, 5, 9, 13));
  const Wide others = densities(four(2, 6, 10, 14), four(3, 7, 11, 15));
  *first = __builtin_shufflevector(pairs, others, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12,
                                   13, 28, 29);
  *second = __builtin_shufflevector(pairs, others, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27,
                                    14, 15, 30, 31);
#else
  const auto densities = [](Quad p, Quad q) {
    return __builtin_shufflevector(p, q, 0, 4, 2, 6);
  };
  const auto four = [&](int l, Quad* low, Quad* high) {
    const Quad pairs = densities(probes(l), probes(l + 1));
    const Quad others = densities(probes(l + 2), probes(l + 3));
    *low = __builtin_shufflevector(pairs, others, 0, 1, 4, 5);
    *high = __builtin_shufflevector(pairs, others, 2, 3, 6, 7);
  };
#if defined(__AVX2__)
  Quad low[2], high[2];
  four(0, &low[0], &high[0]);
  four(4, &low[1], &high[1]);
  *first = __builtin_shufflevector(low[0], low[1], 0, 1, 2, 3, 4, 5, 6, 7);
  *second = __builtin_shufflevector(high[0], high[1], 0, 1, 2, 3, 4, 5, 6, 7);
#else
  four(0, first, second);
#endif
#endif
}

// Within each four lanes: a0 b0 a1 b1, and a2 b2 a3 b3. FoldToQuad sums lanes four apart.
inline Quad ZipLow(Quad a, Quad b) { return __builtin_shufflevector(a, b, 0, 4, 1, 5); }
inline Quad ZipHigh(Quad a, Quad b) { return __builtin_shufflevector(a, b, 2, 6, 3, 7); }
inline Quad FoldToQuad(Quad v) { return v; }
#if defined(__AVX2__)
typedef float Octet __attribute__((vector_size(32)));
inline Octet ZipLow(Octet a, Octet b) {
  return __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13);
}
inline Octet ZipHigh(Octet a, Octet b) {
  return __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
}
inline Quad FoldToQuad(Octet v) {
  return __builtin_shufflevector(v, v, 0, 1, 2, 3) + __builtin_shufflevector(v, v, 4, 5, 6, 7);
}
#endif
#if defined(__AVX512F__)
inline Wide ZipLow(Wide a, Wide b) {
  return __builtin_shufflevector(a, b, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13,
                                 29);
}
inline Wide ZipHigh(Wide a, Wide b) {
  return __builtin_shufflevector(a, b, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15,
                                 31);
}
inline Quad FoldToQuad(Wide v) {
  return FoldToQuad(__builtin_shufflevector(v, v, 0, 1, 2, 3, 4, 5, 6, 7) +
                    __builtin_shufflevector(v, v, 8, 9, 10, 11, 12, 13, 14, 15));
}
#endif

// The sum of all lanes of each of four vectors, side by side.
template <typename Vector>
inline Quad SumEach(const Vector& a, const Vector& b, const Vector& c, const Vector& d) {
  const Vector ac = ZipLow(a, c) + ZipHigh(a, c), bd = ZipLow(b, d) + ZipHigh(b, d);
  return FoldToQuad(ZipLow(ac, bd) + ZipHigh(ac, bd));
}

inline float SumOf(Quad v) {
  const Quad pairs = v + __builtin_shufflevector(v, v, 2, 3, 0, 1);
  return pairs[0] + pairs[1];
}

// std::sqrt may set errno, which prevents the compiler from vectorising it.
inline Quad SquareRoot(Quad v) {
#if defined(__SSE2__)
  return _mm_sqrt_ps(v);
#else
  return Quad{std::sqrt(v[0]), std::sqrt(v[1]), std::sqrt(v[2]), std::sqrt(v[3])};
#endif
}
#if defined(__AVX2__)
inline Octet SquareRoot(Octet v) { return _mm256_sqrt_ps(v); }
#endif
#if defined(__AVX512F__)
// GCC 12 warns about an uninitialized value inside _mm512_sqrt_ps.
inline Wide SquareRoot(Wide v) { return _mm512_maskz_sqrt_ps(0xFFFF, v); }
#endif

}  // namespace
}  // namespace regrade::REGRADE_SIMD_NAMESPACE
