// Caches what a pass over pairs of frames needs of the most recent ones, so that neighbouring
// pairs make it once.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

#include "kernels/scene/image.h"

namespace regrade {

inline int64_t CachedBytes(const Image& image) {
  return static_cast<int64_t>(image.pixels.size() * sizeof(float));
}

// Of values for which CachedBytes is known. Copies share what is kept; values are made one at a
// time, from any thread.
template <typename Value>
class OrderedCache {
 public:
  // Keeps at most `count` values and, if there are more than two, at most `bytes`.
  OrderedCache(std::function<Value(int)> make, int64_t count, int64_t bytes)
      : make_(std::move(make)), max_count_(count), max_bytes_(bytes) {}

  // Returns the cached value or makes it. Beyond the limits the lowest ones are removed first:
  // pairs are visited by ascending first frame.
  std::shared_ptr<const Value> Get(int index) const {
    Shared& shared = *shared_;
    const std::lock_guard lock(shared.mutex);
    const auto found = shared.kept.find(index);
    if (found != shared.kept.end()) return found->second;
    const auto value = std::make_shared<const Value>(make_(index));
    shared.kept[index] = value;
    const int64_t bytes_each = CachedBytes(*value);
    const auto size = [&] { return static_cast<int64_t>(shared.kept.size()); };
    while (size() > 2 && (size() > max_count_ || size() * bytes_each > max_bytes_))
      shared.kept.erase(shared.kept.begin());
    return value;
  }

 private:
  struct Shared {
    std::mutex mutex;
    std::map<int, std::shared_ptr<const Value>> kept;
  };
  std::function<Value(int)> make_;
  int64_t max_count_;
  int64_t max_bytes_;
  std::shared_ptr<Shared> shared_ = std::make_shared<Shared>();
};

using FrameCache = OrderedCache<Image>;

inline constexpr int64_t kFrameCacheBytes = 512ll << 20;  // for all sequences together

}  // namespace regrade
