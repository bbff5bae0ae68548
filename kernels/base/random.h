// Counter-based random numbers: a value is a pure function of (seed, stream, counter), so the
// numbers do not depend on the number of threads or on where a run was resumed.
#pragma once

#include <cstdint>

#include "kernels/base/host_device.h"

namespace regrade {

// splitmix64's finaliser (Steele, Lea, Flood 2014): a bijection with full avalanche.
HD inline uint64_t MixBits(uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

HD inline uint64_t RandomBits(uint64_t seed, uint64_t stream, uint64_t counter) {
  return MixBits(MixBits(MixBits(seed) ^ stream) ^ counter);
}

// Uniform in [0, 1) with 53 bits.
HD inline double RandomDouble(uint64_t seed, uint64_t stream, uint64_t counter) {
  return static_cast<double>(RandomBits(seed, stream, counter) >> 11) * 0x1.0p-53;
}

// Uniform in {0, ..., n - 1}; the bias is below n * 2^-64.
HD inline uint64_t RandomIndex(uint64_t seed, uint64_t stream, uint64_t counter, uint64_t n) {
#if defined(__CUDA_ARCH__)
  return __umul64hi(RandomBits(seed, stream, counter), n);
#else
  return static_cast<uint64_t>(
      (static_cast<unsigned __int128>(RandomBits(seed, stream, counter)) * n) >> 64);
#endif
}

}  // namespace regrade
