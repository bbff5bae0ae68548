// Splits and removes the cells of an adaptive field.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/field/cell_grid.h"

namespace regrade {

enum class CellChange : uint8_t { kRemove, kKeep, kSplit };

// Values of a new vertex are those of the old vertex at its place, or a blend at its place in
// an old cell.
struct VertexSource {
  int32_t vertex = -1;  // of the old cells, or -1
  int32_t cell = -1;    // of the old cells
};

// The cells after `change` [C], with vertices and tree; sources [new V]. A cell of the finest
// level is not split. A vertex that is new takes its values from the first changed cell that
// has it, so the result has one order only.
CellGrid ChangeCells(const CellGrid& old, const Vec3i& voxels,
                     const std::vector<CellChange>& change, std::vector<VertexSource>* sources);

// RMSProp's moments, means of squared gradients, are moved times this: half as wide, a cell is
// crossed by a quarter of the rays, and a sum over them is a quarter. With the parents' moments
// as they are, the first twenty or so steps of every vertex are too short (COSTS.md).
inline constexpr float kMomentOfChildren = 1.0f / 16;

// values [old V, lanes] at the vertices of `to`: out [new V, lanes]. Vertices that were there
// keep their values, so a split leaves the blend inside of a cell as it was, up to rounding,
// unless a finer neighbour has a vertex of its own in one of the cell's faces: that one becomes
// a corner of the children.
void MoveValues(const CellGrid& from, const CellGrid& to,
                const std::vector<VertexSource>& sources, const float* values, int lanes,
                float* out);

}  // namespace regrade
