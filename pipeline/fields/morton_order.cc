#include "pipeline/fields/morton_order.h"

#include <algorithm>
#include <utility>

#include "kernels/base/morton.h"

namespace regrade {

std::vector<int64_t> MortonOrder(const SplatsView<float>& splats) {
  Vec3f low = splats[0].mean, high = low;
  for (int64_t i = 1; i < splats.count; ++i)
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], splats.mean[3 * i + a]);
      high[a] = std::max(high[a], splats.mean[3 * i + a]);
    }
  std::vector<std::pair<uint64_t, int64_t>> keys;
  keys.reserve(static_cast<size_t>(splats.count));
  for (int64_t i = 0; i < splats.count; ++i) {
    Vec3i place;
    for (int a = 0; a < 3; ++a) {
      const double width = double{high[a]} - double{low[a]};
      if (width > 0)
        place[a] = static_cast<int>((double{splats.mean[3 * i + a]} - double{low[a]}) / width *
                                    kMostPlace);
    }
    keys.emplace_back(KeyOf(place), i);
  }
  std::ranges::sort(keys);
  std::vector<int64_t> order;
  order.reserve(keys.size());
  for (const auto& [key, index] : keys) order.push_back(index);
  return order;
}

}  // namespace regrade
