#include "kernels/field/cell_grid.h"

#include <algorithm>
#include <bit>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {
namespace {

CellKey Ancestor(const CellGrid& grid, int64_t cell, int level) {
  return grid.key[cell] >> (3 * (grid.finest - level));
}

// The ancestors of level `level` of all deeper cells, in order.
std::vector<CellKey> NodesOf(const CellGrid& grid, int level) {
  std::vector<CellKey> nodes;
  for (int64_t c = 0; c < grid.num_cells(); ++c) {
    if (grid.level[c] <= level) continue;
    const CellKey key = Ancestor(grid, c, level);
    if (nodes.empty() || nodes.back() != key) nodes.push_back(key);
  }
  return nodes;
}

// Numbers different keys from 0 on, as they come.
class KeyNumbers {
 public:
  KeyNumbers(int64_t most_keys, std::vector<CellKey>* keys)
      : slots_(std::bit_ceil(static_cast<size_t>(2 * most_keys)), -1), keys_(*keys) {}

  int32_t Of(CellKey key) {
    const size_t mask = slots_.size() - 1;
    for (size_t at = (key * 0x9e3779b97f4a7c15u >> 32) & mask;; at = (at + 1) & mask) {
      int32_t& slot = slots_[at];
      if (slot < 0) {
        slot = static_cast<int32_t>(keys_.size());
        keys_.push_back(key);
      }
      if (keys_[static_cast<size_t>(slot)] == key) return slot;
    }
  }

 private:
  std::vector<int32_t> slots_;
  std::vector<CellKey>& keys_;
};

}  // namespace

int64_t FindKey(const Buffer<CellKey>& keys, CellKey key) {
  const CellKey* at = std::lower_bound(keys.begin(), keys.end(), key);
  return at != keys.end() && *at == key ? at - keys.begin() : -1;
}

void FindVertices(CellGrid* grid) {
  const int64_t corners = 8 * grid->num_cells();
  REGRADE_CHECK(corners <= INT32_MAX);
  grid->corner = Buffer<int32_t>(corners);
  // Cells that follow each other are neighbours: most corners of a block are the same vertices.
  constexpr int64_t kBlock = 8 * 4096;
  const int64_t blocks = (corners + kBlock - 1) / kBlock;
  std::vector<std::vector<CellKey>> keys(static_cast<size_t>(blocks));
#pragma omp parallel for schedule(dynamic)
  for (int64_t b = 0; b < blocks; ++b) {
    KeyNumbers numbers(kBlock, &keys[static_cast<size_t>(b)]);
    for (int64_t i = b * kBlock; i < std::min((b + 1) * kBlock, corners); ++i)
      grid->corner[i] = numbers.Of(
          KeyOf(CornerOf(PlaceOf(grid->key[i / 8]), 1 << (grid->finest - grid->level[i / 8]),
                         static_cast<int>(i % 8))));
  }
  std::vector<CellKey> sorted;
  for (const std::vector<CellKey>& of_block : keys)
    sorted.insert(sorted.end(), of_block.begin(), of_block.end());
  std::sort(sorted.begin(), sorted.end());
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
  grid->vertex_key = Buffer<CellKey>(static_cast<int64_t>(sorted.size()));
  std::copy(sorted.begin(), sorted.end(), grid->vertex_key.begin());
#pragma omp parallel for schedule(dynamic)
  for (int64_t b = 0; b < blocks; ++b) {
    std::vector<int32_t> vertex;
    for (const CellKey key : keys[static_cast<size_t>(b)])
      vertex.push_back(static_cast<int32_t>(FindKey(grid->vertex_key, key)));
    for (int64_t i = b * kBlock; i < std::min((b + 1) * kBlock, corners); ++i)
      grid->corner[i] = vertex[static_cast<size_t>(grid->corner[i])];
  }
}

void BuildTree(const Vec3i& voxels, CellGrid* grid) {
  const int finest = grid->finest;
  const CellsView size = ViewOf(*grid, voxels);
  const auto top_index = [&](CellKey key) {
    const Vec3i at = PlaceOf(key);
    return (int64_t{at.x} * size.top_size.y + at.y) * size.top_size.z + at.z;
  };
  grid->top = Buffer<int32_t>(int64_t{size.top_size.x} * size.top_size.y * size.top_size.z);
  std::fill(grid->top.begin(), grid->top.end(), kNoCell);
  std::vector<std::vector<CellKey>> nodes;  // by level
  std::vector<int64_t> first(1, 0);         // node of each level
  for (int level = 0; level < finest; ++level) {
    nodes.push_back(NodesOf(*grid, level));
    first.push_back(first.back() + static_cast<int64_t>(nodes.back().size()));
  }
  grid->nodes = Buffer<int32_t>(8 * first.back());
  std::fill(grid->nodes.begin(), grid->nodes.end(), kNoCell);
  // Where a cell or node of a level with this key is entered: in its parent, or at the top.
  const auto entry = [&](int level, CellKey key) -> int32_t& {
    if (level == 0) return grid->top[top_index(key)];
    const auto& parents = nodes[static_cast<size_t>(level) - 1];
    const auto parent =
        std::lower_bound(parents.begin(), parents.end(), key >> 3) - parents.begin();
    return grid->nodes[8 * (first[static_cast<size_t>(level) - 1] + parent) +
                       static_cast<int64_t>(key & 7)];
  };
  for (int level = 0; level < finest; ++level)
    for (size_t i = 0; i < nodes[static_cast<size_t>(level)].size(); ++i)
      entry(level, nodes[static_cast<size_t>(level)][i]) = EntryOfNode(
          static_cast<int32_t>(first[static_cast<size_t>(level)] + static_cast<int64_t>(i)));
  for (int64_t c = 0; c < grid->num_cells(); ++c)
    entry(grid->level[c], Ancestor(*grid, c, grid->level[c])) = static_cast<int32_t>(c);
}

CellsView ViewOf(const CellGrid& grid, const Vec3i& voxels) {
  const int shift = grid.finest;
  return {{voxels.x >> shift, voxels.y >> shift, voxels.z >> shift},
          grid.finest,
          grid.level.data(),
          grid.corner.data(),
          grid.top.data(),
          grid.nodes.data()};
}

}  // namespace regrade
