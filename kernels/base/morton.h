// Places on a lattice in Morton's order, so that neighbours are near in memory.
#pragma once

#include <cstdint>

#include "kernels/base/vec.h"

namespace regrade {

// Of a place along an axis: three positions of 21 bits fit in a key.
inline constexpr int kMostPlace = (1 << 21) - 1;

// The 21 lowest bits of x, each two bits apart from the next.
inline uint64_t SpreadBits(uint64_t x) {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x1f00000000ffffull;
  x = (x | x << 16) & 0x1f0000ff0000ffull;
  x = (x | x << 8) & 0x100f00f00f00f00full;
  x = (x | x << 4) & 0x10c30c30c30c30c3ull;
  return (x | x << 2) & 0x1249249249249249ull;
}

// Interleaves the bits of a place, x highest.
inline uint64_t KeyOf(const Vec3i& at) {
  return SpreadBits(static_cast<uint64_t>(at.x)) << 2 |
         SpreadBits(static_cast<uint64_t>(at.y)) << 1 | SpreadBits(static_cast<uint64_t>(at.z));
}

}  // namespace regrade
