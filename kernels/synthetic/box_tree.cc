#include "kernels/synthetic/box_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace regrade {
namespace {

constexpr int kLeafSize = 2;
constexpr int kBins = 16;
constexpr double kMargin = 1e-5;  // world units, and of the coordinates

void Include(const Box& other, Box* box) {
  for (int a = 0; a < 3; ++a) {
    box->low[a] = std::min(box->low[a], other.low[a]);
    box->high[a] = std::max(box->high[a], other.high[a]);
  }
}

Box Enlarged(Box box) {
  for (int a = 0; a < 3; ++a) {
    box.low[a] -= kMargin * (1 + std::abs(box.low[a]));
    box.high[a] += kMargin * (1 + std::abs(box.high[a]));
  }
  return box;
}

double HalfArea(const Box& box) {
  const Vec3d side = box.high - box.low;
  if (side.x < 0) return 0;
  return side.x * side.y + side.y * side.z + side.z * side.x;
}

double Middle(const Box& box, int axis) { return 0.5 * (box.low[axis] + box.high[axis]); }

// Where to divide boxes: those with their middle in one of the first `bins` bins go first.
struct Division {
  int axis = 0, bins = 0;
  double low = 0, bins_per_unit = 0;
  double cost = std::numeric_limits<double>::infinity();

  int BinOf(const Box& box) const {
    return std::clamp(static_cast<int>((Middle(box, axis) - low) * bins_per_unit), 0,
                      kBins - 1);
  }
};

// The division with the least surface times number of boxes (Wald 2007: on fast construction
// of SAH-based bounding volume hierarchies).
Division BestDivision(const std::vector<Box>& boxes, const int* order, int count) {
  Division best;
  for (int axis = 0; axis < 3; ++axis) {
    double low = 1e300, high = -1e300;
    for (int k = 0; k < count; ++k) {
      low = std::min(low, Middle(boxes[order[k]], axis));
      high = std::max(high, Middle(boxes[order[k]], axis));
    }
    if (!(high > low)) continue;
    Division division{axis, 0, low, kBins / (high - low)};
    std::array<Box, kBins> bin_box;
    std::array<int, kBins> bin_count{};
    for (int k = 0; k < count; ++k) {
      const int bin = division.BinOf(boxes[order[k]]);
      Include(boxes[order[k]], &bin_box[bin]);
      ++bin_count[bin];
    }
    std::array<double, kBins> above{};  // cost of the bins from i on
    Box box;
    for (int i = kBins - 1, n = 0; i > 0; --i) {
      Include(bin_box[i], &box);
      above[i] = HalfArea(box) * (n += bin_count[i]);
    }
    box = {};
    for (int i = 1, n = 0; i < kBins; ++i) {
      Include(bin_box[i - 1], &box);
      n += bin_count[i - 1];
      if (n == 0 || n == count) continue;
      division.bins = i;
      division.cost = HalfArea(box) * n + above[i];
      if (division.cost < best.cost) best = division;
    }
  }
  return best;
}

}  // namespace

BoxTree::BoxTree(const std::vector<Box>& boxes) : order_(boxes.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  if (!boxes.empty()) Build(boxes, 0, static_cast<int>(boxes.size()), 0);
}

void BoxTree::Build(const std::vector<Box>& boxes, int first, int count, int depth) {
  const size_t n = nodes_.size();
  nodes_.emplace_back();
  Box box;
  for (int k = first; k < first + count; ++k) Include(boxes[order_[k]], &box);
  box = Enlarged(box);
  nodes_[n].corner[0] = box.low;
  nodes_[n].corner[1] = box.high;
  nodes_[n].first = first;
  nodes_[n].count = count;
  if (count <= kLeafSize || depth == kMaxDepth) return;
  const auto begin = order_.begin() + first, end = begin + count;
  const Division division = BestDivision(boxes, &*begin, count);
  if (division.bins == 0) return;  // all at the same place
  const auto middle = std::partition(
      begin, end, [&](int i) { return division.BinOf(boxes[i]) < division.bins; });
  const int in_first = static_cast<int>(middle - begin);
  nodes_[n].count = 0;
  nodes_[n].axis = division.axis;
  Build(boxes, first, in_first, depth + 1);
  nodes_[n].first = static_cast<int>(nodes_.size());
  Build(boxes, first + in_first, count - in_first, depth + 1);
}

std::vector<int> BoxTree::Around(const Vec3d& point) const {
  std::vector<int> found;
  int stack[kMaxDepth + 1], size = 0;
  for (int n = nodes_.empty() ? -1 : 0; n >= 0; n = size > 0 ? stack[--size] : -1) {
    while (true) {
      const Node& node = nodes_[n];
      bool inside = true;
      for (int a = 0; a < 3; ++a)
        inside = inside && point[a] >= node.corner[0][a] && point[a] <= node.corner[1][a];
      if (!inside) break;
      if (node.count > 0) {
        found.insert(found.end(), order_.begin() + node.first,
                     order_.begin() + node.first + node.count);
        break;
      }
      stack[size++] = node.first;
      ++n;
    }
  }
  std::ranges::sort(found);
  return found;
}

}  // namespace regrade
