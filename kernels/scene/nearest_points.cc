#include "kernels/scene/nearest_points.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace regrade {
namespace {

constexpr int64_t kLeaf = 16;  // points

using Found = std::vector<std::pair<float, int32_t>>;  // squared distance, point; a heap

// The middle of a range of points parts it along the range's axis; halves are parted likewise.
class Tree {
 public:
  explicit Tree(const std::vector<Vec3f>& points) : points_(points), order_(points.size()) {
    std::iota(order_.begin(), order_.end(), 0);
    axis_.resize(order_.size());
    Divide(0, std::ssize(order_));
  }

  void Find(int32_t point, int count, Found* found) const {
    found->clear();
    Search(0, std::ssize(order_), point, static_cast<size_t>(count), found);
    std::sort_heap(found->begin(), found->end());
  }

 private:
  const Vec3f& At(int64_t place) const {
    return points_[static_cast<size_t>(order_[static_cast<size_t>(place)])];
  }

  void Divide(int64_t begin, int64_t end) {
    if (end - begin <= kLeaf) return;
    Vec3f low = At(begin), high = low;
    for (int64_t i = begin; i < end; ++i)
      for (int a = 0; a < 3; ++a)
        low[a] = std::min(low[a], At(i)[a]), high[a] = std::max(high[a], At(i)[a]);
    const Vec3f size = high - low;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const int64_t middle = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](int32_t a, int32_t b) {
                       return points_[static_cast<size_t>(a)][axis] <
                              points_[static_cast<size_t>(b)][axis];
                     });
    axis_[static_cast<size_t>(middle)] = static_cast<int8_t>(axis);
    Divide(begin, middle);
    Divide(middle + 1, end);
  }

  void Consider(int64_t place, int32_t point, size_t count, Found* found) const {
    const int32_t other = order_[static_cast<size_t>(place)];
    if (other == point) return;
    const Vec3f d = At(place) - points_[static_cast<size_t>(point)];
    const std::pair<float, int32_t> candidate{Dot(d, d), other};
    if (found->size() == count) {
      if (!(candidate < found->front())) return;
      std::pop_heap(found->begin(), found->end());
      found->pop_back();
    }
    found->push_back(candidate);
    std::push_heap(found->begin(), found->end());
  }

  void Search(int64_t begin, int64_t end, int32_t point, size_t count, Found* found) const {
    if (end - begin <= kLeaf) {
      for (int64_t i = begin; i < end; ++i) Consider(i, point, count, found);
      return;
    }
    const int64_t middle = begin + (end - begin) / 2;
    const int axis = axis_[static_cast<size_t>(middle)];
    const float beyond = points_[static_cast<size_t>(point)][axis] - At(middle)[axis];
    const bool left = beyond < 0;
    const auto search = [&](bool first) {
      if (first == left)
        Search(begin, middle, point, count, found);
      else
        Search(middle + 1, end, point, count, found);
    };
    search(true);
    Consider(middle, point, count, found);
    if (found->size() < count || beyond * beyond <= found->front().first) search(false);
  }

  const std::vector<Vec3f>& points_;
  std::vector<int32_t> order_;
  std::vector<int8_t> axis_;  // [points]: of a range, at its middle
};

}  // namespace

std::vector<int32_t> NearestPoints(const std::vector<Vec3f>& points, int count) {
  const Tree tree(points);
  const int64_t n = std::ssize(points);
  std::vector<int32_t> nearest(static_cast<size_t>(n * count), -1);
#pragma omp parallel
  {
    Found found;
#pragma omp for schedule(dynamic, 256)
    for (int64_t i = 0; i < n; ++i) {
      tree.Find(static_cast<int32_t>(i), count, &found);
      for (size_t k = 0; k < found.size(); ++k)
        nearest[static_cast<size_t>(i * count) + k] = found[k].second;
    }
  }
  return nearest;
}

}  // namespace regrade
