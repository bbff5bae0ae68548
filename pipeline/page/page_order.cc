// The order of a grid's voxels: brick by brick.
#include "pipeline/page/page_order.h"

#include <algorithm>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr int kBrickBytes = kPageBrick * kPageBrick * kPageBrick / 8;
constexpr int64_t kMaxBricks = int64_t{1} << 24;

Vec3i BricksOf(const Vec3i& voxels) {
  return {(voxels.x + kPageBrick - 1) / kPageBrick, (voxels.y + kPageBrick - 1) / kPageBrick,
          (voxels.z + kPageBrick - 1) / kPageBrick};
}

int64_t IndexIn(const Vec3i& size, const Vec3i& at) {
  return (int64_t{at.x} * size.y + at.y) * size.z + at.z;
}

// Whether a cell around the vertex has a corner of positive density.
bool IsSeen(const Geometry& geometry, const Vec3i& at) {
  const Vec3i n = geometry.frame.resolution;
  for (int x = std::max(at.x - 1, 0); x <= std::min(at.x + 1, n.x - 1); ++x)
    for (int y = std::max(at.y - 1, 0); y <= std::min(at.y + 1, n.y - 1); ++y)
      for (int z = std::max(at.z - 1, 0); z <= std::min(at.z + 1, n.z - 1); ++z) {
        const int32_t link = geometry.links[geometry.frame.Vertex(x, y, z)];
        if (link >= 0 && geometry.density[link] > 0) return true;
      }
  return false;
}

// Calls visit(vertex, its number in the brick) for the vertices of a brick that are in the box.
template <typename Visit>
void VisitBrick(const Vec3i& voxels, const Vec3i& brick, const Visit& visit) {
  for (int i = 0; i < kPageBrick * kPageBrick * kPageBrick; ++i) {
    const Vec3i at{brick.x * kPageBrick + i / (kPageBrick * kPageBrick),
                   brick.y * kPageBrick + i / kPageBrick % kPageBrick,
                   brick.z * kPageBrick + i % kPageBrick};
    if (at.x < voxels.x && at.y < voxels.y && at.z < voxels.z) visit(at, i);
  }
}

template <typename Visit>
void VisitBricks(const Vec3i& bricks, const Visit& visit) {
  for (int x = 0; x < bricks.x; ++x)
    for (int y = 0; y < bricks.y; ++y)
      for (int z = 0; z < bricks.z; ++z) visit(Vec3i{x, y, z});
}

}  // namespace

std::string MaskOfGrid(const Geometry& geometry) {
  const Vec3i voxels = geometry.frame.resolution, bricks = BricksOf(voxels);
  std::string flags(static_cast<size_t>((IndexIn(bricks, {bricks.x, 0, 0}) + 7) / 8), '\0');
  std::string masks;
  const auto set = [](std::string* bits, int64_t i) {
    (*bits)[static_cast<size_t>(i / 8)] |= static_cast<char>(1 << (i % 8));
  };
  VisitBricks(bricks, [&](const Vec3i& brick) {
    std::string mask(kBrickBytes, '\0');
    VisitBrick(voxels, brick, [&](const Vec3i& at, int i) {
      if (geometry.links[geometry.frame.Vertex(at.x, at.y, at.z)] >= 0 && IsSeen(geometry, at))
        set(&mask, i);
    });
    if (mask.find_first_not_of('\0') == std::string::npos) return;
    set(&flags, IndexIn(bricks, brick));
    masks += mask;
  });
  return flags + masks;
}

PageOrder OrderOfMask(std::string_view mask, const Vec3i& voxels) {
  const Vec3i bricks = BricksOf(voxels);
  int64_t count = 1;
  for (int a = 0; a < 3; ++a) {
    if (voxels[a] < 2 || voxels[a] > kMaxPageSide)
      throw InputError("the size of the grid is not valid");
    count *= bricks[a];
    if (count > kMaxBricks) throw InputError("the grid has too many bricks");
  }
  size_t next = static_cast<size_t>((count + 7) / 8);
  if (mask.size() < next) throw InputError("the mask of voxels ends too early");
  const auto bit = [&](size_t byte, int64_t i) {
    return static_cast<unsigned char>(mask[byte + static_cast<size_t>(i / 8)]) >> (i % 8) & 1;
  };
  PageOrder order;
  // Numbers of the vertices of the slabs x - 1 and x, to find neighbours in.
  const int64_t slab = int64_t{voxels.y} * voxels.z;
  if (slab * (kPageBrick + 1) > kMaxPageVoxels)
    throw InputError("the size of the grid is not valid");
  std::vector<int32_t> number(static_cast<size_t>(slab * (kPageBrick + 1)), -1);
  const auto at_slab = [&](const Vec3i& at) -> int32_t& {
    return number[static_cast<size_t>(slab * (at.x % (kPageBrick + 1)) +
                                      int64_t{at.y} * voxels.z + at.z)];
  };
  int cleared = 0;  // slabs up to here hold numbers of this pass
  VisitBricks(bricks, [&](const Vec3i& brick) {
    for (; cleared < std::min((brick.x + 1) * kPageBrick, voxels.x); ++cleared)
      std::fill_n(number.begin() + slab * (cleared % (kPageBrick + 1)), slab, -1);
    if (!bit(0, IndexIn(bricks, brick))) return;
    if (mask.size() < next + kBrickBytes) throw InputError("the mask of voxels ends too early");
    VisitBrick(voxels, brick, [&](const Vec3i& at, int i) {
      if (!bit(next, i)) return;
      const auto own = static_cast<int32_t>(order.place.size());
      if (own >= kMaxPageVoxels) throw InputError("there are too many voxels for a page");
      EarlierRecords earlier{-1, -1, -1};
      int n = 0;
      for (int a = 0; a < 3; ++a) {
        Vec3i before = at;
        if (before[a]-- > 0 && at_slab(before) >= 0) earlier[n++] = at_slab(before);
      }
      if (n == 0) earlier[0] = own - 1;
      at_slab(at) = own;
      order.place.push_back(at);
      order.earlier.push_back(earlier);
    });
    next += kBrickBytes;
  });
  if (next != mask.size()) throw InputError("bytes follow the mask of voxels");
  return order;
}

}  // namespace regrade
