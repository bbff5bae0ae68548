// The cells of an adaptive field: leaves of an octree, with values at their corners.
//
// Leaves of any levels may be neighbours. A vertex is a place, whatever cells have it as a
// corner: cells of two levels share the values at the places that both have as corners. A finer
// cell's corner in the middle of a coarser cell's face is a vertex of its own.
#pragma once

#include <cstdint>

#include "kernels/base/buffer.h"
#include "kernels/field/cell_lattice.h"

namespace regrade {

// Entries of the tree: a cell, nothing, or a node.
inline constexpr int32_t kNoCell = -1;
HD inline bool IsNode(int32_t entry) { return entry < kNoCell; }
HD inline int32_t NodeOf(int32_t entry) { return -2 - entry; }
HD inline int32_t EntryOfNode(int32_t node) { return -2 - node; }

struct CellGrid {
  int finest = 0;  // L: the finest level
  // Cells, in the order of their keys.
  Buffer<CellKey> key;     // [C]: of the lowest corner
  Buffer<uint8_t> level;   // [C]
  Buffer<int32_t> corner;  // [C, 8]: vertices
  // Vertices, in the order of their keys.
  Buffer<CellKey> vertex_key;  // [V]
  // Derived: see BuildTree.
  Buffer<int32_t> top;    // [cells of level 0, z fastest]
  Buffer<int32_t> nodes;  // [nodes, 8]: children as corners are numbered

  bool on() const { return key.size() > 0; }
  int64_t num_cells() const { return key.size(); }
  int64_t num_vertices() const { return vertex_key.size(); }
};

// Finds the vertices and the tree of cells that have keys and levels, in order. `voxels`: those
// of the box along each axis, multiples of 2^finest.
void FindVertices(CellGrid* grid);
void BuildTree(const Vec3i& voxels, CellGrid* grid);

// Position of `key` in keys in order, or -1.
int64_t FindKey(const Buffer<CellKey>& keys, CellKey key);

// A non-owning view for kernel bodies.
struct CellsView {
  Vec3i top_size;  // cells of level 0
  int finest = 0;
  const uint8_t* level = nullptr;
  const int32_t* corner = nullptr;
  const int32_t* top = nullptr;
  const int32_t* nodes = nullptr;
};
CellsView ViewOf(const CellGrid& grid, const Vec3i& voxels);

// What is at the voxel `at`: the cell or kNoCell, and the width in voxels of the cell, or of
// the largest empty cube of the tree there.
HD inline int32_t CellAt(const CellsView& cells, const Vec3i& at, int* width) {
  int shift = cells.finest;
  int32_t entry =
      cells.top[((at.x >> shift) * cells.top_size.y + (at.y >> shift)) * cells.top_size.z +
                (at.z >> shift)];
  while (IsNode(entry)) {
    --shift;
    entry =
        cells
            .nodes[int64_t{NodeOf(entry)} * 8 +
                   ((at.x >> shift & 1) << 2 | (at.y >> shift & 1) << 1 | (at.z >> shift & 1))];
  }
  *width = 1 << shift;
  return entry;
}

// CellAt for voxels near each other, one after the other: it keeps the nodes above the last one
// and begins at the smallest that holds the next voxel, too.
class CellPath {
 public:
  explicit CellPath(const CellsView& cells) : cells_(cells) {}

  int32_t operator()(const Vec3i& at, int* width) {
    const uint32_t differs =
        static_cast<uint32_t>((at.x ^ last_.x) | (at.y ^ last_.y) | (at.z ^ last_.z));
    int shift = differs == 0 ? 0 : 32 - __builtin_clz(differs);  // of the cube that holds both
    if (shift < leaf_shift_) shift = leaf_shift_;
    last_ = at;
    int32_t entry;
    if (shift <= cells_.finest) {
      entry = entry_[shift];
    } else {
      shift = cells_.finest;
      entry = entry_[shift] =
          cells_
              .top[((at.x >> shift) * cells_.top_size.y + (at.y >> shift)) * cells_.top_size.z +
                   (at.z >> shift)];
    }
    while (IsNode(entry)) {
      --shift;
      entry = entry_[shift] = cells_.nodes[int64_t{NodeOf(entry)} * 8 +
                                           ((at.x >> shift & 1) << 2 |
                                            (at.y >> shift & 1) << 1 | (at.z >> shift & 1))];
    }
    leaf_shift_ = shift;
    *width = 1 << shift;
    return entry;
  }

 private:
  static constexpr int kMostLevels = 32;

  CellsView cells_;
  Vec3i last_{-1, -1, -1};  // differs from every voxel in the highest bit
  int leaf_shift_ = 0;
  int32_t entry_[kMostLevels] = {};  // of the cube of 2^k voxels that holds the last voxel
};

}  // namespace regrade
