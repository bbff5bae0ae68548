#include "kernels/field/cell_checks.h"

namespace regrade {
namespace {

std::string DefectOfBox(int finest, const Vec3i& voxels) {
  if (finest < 0 || finest > kMaxCellLevel)
    return "the finest level is " + std::to_string(finest) + ", 0 to " +
           std::to_string(kMaxCellLevel) + " are supported";
  int64_t top = 1;
  for (int a = 0; a < 3; ++a) {
    if (voxels[a] < 1 || voxels[a] > kMaxLattice || voxels[a] % (1 << finest) != 0)
      return "a box of " + std::to_string(voxels[a]) +
             " voxels along an axis does not divide into cells of level 0";
    top *= voxels[a] >> finest;  // at most 2^60
  }
  if (top > kMaxTopCells)
    return std::to_string(top) + " cells of level 0, at most " + std::to_string(kMaxTopCells) +
           " are supported";
  return "";
}

}  // namespace

std::string DefectOfCells(const CellGrid& grid, const Vec3i& voxels) {
  const int64_t n = grid.num_cells();
  if (grid.level.size() != n) return "keys and levels of the cells differ in number";
  if (8 * n > INT32_MAX) return std::to_string(n) + " cells are too many";
  const std::string of_box = DefectOfBox(grid.finest, voxels);
  if (!of_box.empty()) return of_box;
  CellKey free = 0;  // the first key that no cell before covers
  int64_t nodes = 0;
  for (int64_t c = 0; c < n; ++c) {
    const Vec3i at = PlaceOf(grid.key[c]);
    const int shift = grid.finest - grid.level[c];
    bool inside = shift >= 0 && grid.key[c] >= free && grid.key[c] >> 63 == 0;
    for (int a = 0; a < 3 && inside; ++a)
      inside = at[a] % (1 << shift) == 0 && at[a] < voxels[a];
    if (!inside)
      return "cell " + std::to_string(c) + " overlaps another, or is not in its place";
    free = grid.key[c] + (CellKey{1} << (3 * shift));
    // Ancestors that the cell before does not have.
    for (int level = 0; level < grid.level[c]; ++level) {
      const int bits = 3 * (grid.finest - level);
      nodes += c == 0 || grid.key[c] >> bits != grid.key[c - 1] >> bits;
    }
  }
  if (nodes > kMaxNodes) return "a tree of " + std::to_string(nodes) + " nodes is too large";
  return "";
}

}  // namespace regrade
