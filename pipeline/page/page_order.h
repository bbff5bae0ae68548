// The order in which a page stores the voxels of a field, and what is stored of their places.
//
// A page leaves out what no ray can see: cells, and voxels of a uniform grid, around which no
// density is positive. The order lets a reader find places from few bytes, and keeps
// neighbours together, from which each voxel is predicted.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "kernels/field/cell_lattice.h"
#include "kernels/field/radiance_field.h"

namespace regrade {

inline constexpr int kPageBrick = 8;  // voxels along the edge of a brick
inline constexpr int64_t kMaxPageVoxels = int64_t{1} << 26;

// Up to three earlier voxels, numbered in the page's order; -1: fewer.
using EarlierVoxels = std::array<int32_t, 3>;

struct PageCell {
  Vec3i low;  // lowest corner
  int level;
};

struct PageOrder {
  std::vector<PageCell> cells;         // of an adaptive field, in the page's order
  std::vector<Vec3i> place;            // [V]: vertex of the lattice, or of the grid
  std::vector<EarlierVoxels> earlier;  // [V]
  std::vector<uint8_t> width_log2;     // [V]: of the widest cell around it, voxels
};

// Adaptive fields: a symbol of two bits for each cell of level 0 in the order of its index (z
// fastest) and, behind a node, for each of its children, as corners are numbered; four symbols
// a byte, the lowest bits first. 0: nothing, 1: a cell, 2: a node.
std::string TreeOfCells(const Geometry& geometry);
// Voxels appear when the first cell has them as a corner; they are predicted from neighbours
// along this cell's edges. Throws Error(kInput) for symbols that are no tree.
PageOrder OrderOfTree(std::string_view tree, const Vec3i& voxels, int finest);

// Uniform grids: a bit for each brick of kPageBrick^3 vertices (z fastest, the lowest bit
// first), and behind these bits 64 bytes for each brick whose bit is set: a bit for each
// vertex.
std::string MaskOfGrid(const Geometry& geometry);
// Throws Error(kInput) for bytes of another size.
PageOrder OrderOfMask(std::string_view mask, const Vec3i& voxels);

}  // namespace regrade
