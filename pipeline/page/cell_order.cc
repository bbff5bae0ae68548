// The order of an adaptive field's voxels: a walk through the tree of its cells.
#include <unordered_map>

#include "kernels/base/error.h"
#include "kernels/field/cell_checks.h"
#include "pipeline/page/page_order.h"

namespace regrade {
namespace {

enum Symbol { kNothing, kCell, kNode };

class SymbolWriter {
 public:
  void Add(int symbol) {
    if (count_++ % 4 == 0) bytes_ += '\0';
    bytes_.back() = static_cast<char>(static_cast<unsigned char>(bytes_.back()) |
                                      symbol << (2 * ((count_ - 1) % 4)));
  }
  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
  int64_t count_ = 0;
};

class SymbolReader {
 public:
  explicit SymbolReader(std::string_view bytes) : bytes_(bytes) {}
  int Next() {
    const size_t at = static_cast<size_t>(count_ / 4);
    if (at >= bytes_.size()) throw InputError("the tree of cells ends too early");
    return static_cast<unsigned char>(bytes_[at]) >> (2 * (count_++ % 4)) & 3;
  }
  bool AtEnd() const { return static_cast<int64_t>(bytes_.size()) == (count_ + 3) / 4; }

 private:
  std::string_view bytes_;
  int64_t count_ = 0;
};

// Whether a ray can see the cell: a trilinear blend is nowhere above its corners.
bool IsSeen(const Geometry& geometry, int32_t cell) {
  for (int k = 0; k < 8; ++k)
    if (geometry.density[geometry.cells.corner[8 * int64_t{cell} + k]] > 0) return true;
  return false;
}

void AddEntry(const Geometry& geometry, int32_t entry, SymbolWriter* symbols) {
  if (!IsNode(entry)) {
    symbols->Add(entry != kNoCell && IsSeen(geometry, entry) ? kCell : kNothing);
    return;
  }
  symbols->Add(kNode);
  for (int k = 0; k < 8; ++k)
    AddEntry(geometry, geometry.cells.nodes[8 * int64_t{NodeOf(entry)} + k], symbols);
}

class TreeWalk {
 public:
  TreeWalk(std::string_view tree, int finest) : symbols_(tree), finest_(finest) {}

  void Visit(const Vec3i& low, int level) {
    const int symbol = symbols_.Next();
    if (symbol == kNothing) return;
    if (symbol == kCell) return AddCell(low, level);
    if (symbol != kNode || level >= finest_)
      throw InputError("the tree of cells has a symbol that it may not have");
    for (int k = 0; k < 8; ++k) Visit(CornerOf(low, 1 << (finest_ - level - 1), k), level + 1);
  }
  PageOrder Take() {
    if (!symbols_.AtEnd()) throw InputError("bytes follow the tree of cells");
    return std::move(order_);
  }

 private:
  void AddCell(const Vec3i& low, int level) {
    const int log2 = finest_ - level;
    int32_t corner[8];
    order_.cells.push_back({low, level});
    for (int k = 0; k < 8; ++k) {
      const Vec3i place = CornerOf(low, 1 << log2, k);
      const auto next = static_cast<int32_t>(order_.place.size());
      const auto [at, added] = index_.try_emplace(KeyOf(place), next);
      corner[k] = at->second;
      if (!added) {
        uint8_t& widest = order_.width_log2[static_cast<size_t>(corner[k])];
        if (log2 > widest) widest = static_cast<uint8_t>(log2);
        continue;
      }
      order_.place.push_back(place);
      order_.width_log2.push_back(static_cast<uint8_t>(log2));
      order_.earlier.push_back({-1, -1, -1});
      if (next >= kMaxPageVoxels) throw InputError("there are too many voxels for a page");
    }
    for (int k = 0; k < 8; ++k) PredictFrom(corner, k);
  }

  // A voxel that this cell has added has been predicted from nothing yet.
  void PredictFrom(const int32_t* corner, int k) {
    if (corner[k] < predicted_) return;
    predicted_ = corner[k] + 1;
    EarlierVoxels& earlier = order_.earlier[static_cast<size_t>(corner[k])];
    int n = 0;
    for (const int edge : {1, 2, 4})
      if (corner[k ^ edge] < corner[k]) earlier[n++] = corner[k ^ edge];
    if (n == 0) earlier[0] = corner[k] - 1;
  }

  SymbolReader symbols_;
  int finest_;
  int32_t predicted_ = 0;
  PageOrder order_;
  std::unordered_map<CellKey, int32_t> index_;
};

}  // namespace

std::string TreeOfCells(const Geometry& geometry) {
  SymbolWriter symbols;
  for (const int32_t entry : geometry.cells.top) AddEntry(geometry, entry, &symbols);
  return symbols.Take();
}

PageOrder OrderOfTree(std::string_view tree, const Vec3i& voxels, int finest) {
  if (finest < 0 || finest > kMaxCellLevel)
    throw InputError("the levels of cells are not valid");
  int64_t top = 1;
  for (int a = 0; a < 3; ++a) {
    if (voxels[a] < 1 || voxels[a] > kMaxLattice || voxels[a] % (1 << finest) != 0)
      throw InputError("the size of the box is not valid");
    top *= voxels[a] >> finest;
    if (top > kMaxTopCells) throw InputError("the box has too many cells");
  }
  TreeWalk walk(tree, finest);
  const int width = 1 << finest;
  for (int x = 0; x < voxels.x; x += width)
    for (int y = 0; y < voxels.y; y += width)
      for (int z = 0; z < voxels.z; z += width) walk.Visit({x, y, z}, 0);
  return walk.Take();
}

}  // namespace regrade
