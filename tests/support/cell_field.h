// A small random adaptive field, for tests of its rendering and fitting.
#pragma once

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "kernels/base/random.h"
#include "kernels/field/cell_grid.h"
#include "kernels/field/refine_cells.h"
#include "tests/support/small_field.h"

namespace regrade::testing {

// All cells of level 0 of a box of `top` cells, with levels down to `finest`.
inline CellGrid TopCells(const Vec3i& top, int finest) {
  CellGrid grid;
  grid.finest = finest;
  std::vector<CellKey> keys;
  for (int x = 0; x < top.x; ++x)
    for (int y = 0; y < top.y; ++y)
      for (int z = 0; z < top.z; ++z)
        keys.push_back(KeyOf({x << finest, y << finest, z << finest}));
  std::sort(keys.begin(), keys.end());
  grid.key = Buffer<CellKey>(static_cast<int64_t>(keys.size()));
  std::copy(keys.begin(), keys.end(), grid.key.begin());
  grid.level = Buffer<uint8_t>(grid.key.size());
  FindVertices(&grid);
  BuildTree({top.x << finest, top.y << finest, top.z << finest}, &grid);
  return grid;
}

// Cells of all levels in random places; a fraction `removed` of them is taken out after each
// split.
inline CellGrid RandomCells(const Vec3i& top, int finest, double removed, uint64_t seed) {
  CellGrid grid = TopCells(top, finest);
  const Vec3i voxels{top.x << finest, top.y << finest, top.z << finest};
  for (int level = 0; level < finest; ++level) {
    std::vector<CellChange> change;
    for (int64_t c = 0; c < grid.num_cells(); ++c) {
      const double u =
          RandomDouble(seed, static_cast<uint64_t>(level), static_cast<uint64_t>(c));
      change.push_back(u < removed ? CellChange::kRemove
                       : u < 0.5   ? CellChange::kSplit
                                   : CellChange::kKeep);
    }
    std::vector<VertexSource> sources;
    grid = ChangeCells(grid, voxels, change, &sources);
  }
  return grid;
}

inline RadianceField CellField(CellGrid cells, const Vec3i& voxels, int basis, uint64_t seed) {
  auto geometry = std::make_shared<Geometry>();
  geometry->frame = SmallFrame(voxels);
  const int64_t count = cells.num_vertices();
  geometry->cells = std::move(cells);
  return RandomValues(std::move(geometry), count, basis, seed);
}

inline RadianceField RandomCellField(const Vec3i& top, int finest, int basis, uint64_t seed) {
  return CellField(RandomCells(top, finest, 0.15, seed),
                   {top.x << finest, top.y << finest, top.z << finest}, basis, seed);
}

}  // namespace regrade::testing
