// Where the cells of an adaptive field lie: levels of halved cells over one box.
//
// EQ(cell-lattice): the box of a frame with N_a voxels along axis a is divided into N_a / 2^L
// cells of level 0; a cell of level l is 2^(L - l) voxels wide and has eight children of level
// l + 1. Positions in voxels count from the box's corner; a vertex has integer ones, 0 to N_a.
// Sums along rays use positions that count from the box's centre: there floats are finest, and
// cameras look there.
#pragma once

#include <cstdint>

#include "kernels/base/host_device.h"
#include "kernels/base/vec.h"

namespace regrade {

inline constexpr int kMaxCellLevel = 16;
inline constexpr int kMaxLattice =
    1 << 20;  // voxels along an axis: three positions of 21 bits fit in a key

// A key interleaves the bits of a position, x highest: cells and vertices in the order of their
// keys follow Morton's curve, so that neighbours are near in memory, and the bits above 3 (L -
// l) name the ancestor of level l.
using CellKey = uint64_t;

HD inline CellKey SpreadBits(uint64_t x) {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x1f00000000ffffull;
  x = (x | x << 16) & 0x1f0000ff0000ffull;
  x = (x | x << 8) & 0x100f00f00f00f00full;
  x = (x | x << 4) & 0x10c30c30c30c30c3ull;
  return (x | x << 2) & 0x1249249249249249ull;
}

HD inline int GatherBits(CellKey x) {
  x &= 0x1249249249249249ull;
  x = (x ^ x >> 2) & 0x10c30c30c30c30c3ull;
  x = (x ^ x >> 4) & 0x100f00f00f00f00full;
  x = (x ^ x >> 8) & 0x1f0000ff0000ffull;
  x = (x ^ x >> 16) & 0x1f00000000ffffull;
  return static_cast<int>((x ^ x >> 32) & 0x1fffff);
}

HD inline CellKey KeyOf(const Vec3i& at) {
  return SpreadBits(static_cast<uint64_t>(at.x)) << 2 |
         SpreadBits(static_cast<uint64_t>(at.y)) << 1 | SpreadBits(static_cast<uint64_t>(at.z));
}
HD inline Vec3i PlaceOf(CellKey key) {
  return {GatherBits(key >> 2), GatherBits(key >> 1), GatherBits(key)};
}

// Corner k of 8 of a cell, as in trilinear.h: bit 2 is +x, bit 1 is +y, bit 0 is +z.
HD inline Vec3i CornerOf(const Vec3i& lowest, int width, int corner) {
  return {lowest.x + (corner >> 2 & 1) * width, lowest.y + (corner >> 1 & 1) * width,
          lowest.z + (corner & 1) * width};
}

}  // namespace regrade
