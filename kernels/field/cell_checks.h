// Checks the cells of an adaptive field from an untrusted source.
#pragma once

#include <string>

#include "kernels/field/cell_grid.h"

namespace regrade {

// Cells of level 0, and nodes: what a tree has beyond the cells that are stored.
inline constexpr int64_t kMaxTopCells = int64_t{1} << 24;
inline constexpr int64_t kMaxNodes = int64_t{1} << 28;

// What is wrong with `finest`, keys and levels in a box of `voxels`, or "". Cells without a
// defect lie in the box, apart from each other and in order, and FindVertices and BuildTree
// accept them.
std::string DefectOfCells(const CellGrid& grid, const Vec3i& voxels);

}  // namespace regrade
