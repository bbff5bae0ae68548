// Caches the most recent frames of a sequential pass, so that neighbouring pairs decode each
// frame once.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <utility>

#include "evaluate/frame_source.h"

namespace regrade {

class FrameCache {
 public:
  // Keeps at most `frames` frames and, if there are more than two, at most `bytes` of pixels.
  FrameCache(FrameSource source, int64_t frames, int64_t bytes)
      : source_(std::move(source)), max_frames_(frames), max_bytes_(bytes) {}

  // Returns the cached frame or loads it. Beyond the limits the lowest frames are removed
  // first: pairs are visited by ascending first frame.
  std::shared_ptr<const Image> Get(int index) {
    const auto found = kept_.find(index);
    if (found != kept_.end()) return found->second;
    const auto image = std::make_shared<const Image>(source_.frame(index));
    kept_[index] = image;
    const int64_t bytes_each = static_cast<int64_t>(image->pixels.size() * sizeof(float));
    while (Size() > 2 && (Size() > max_frames_ || Size() * bytes_each > max_bytes_))
      kept_.erase(kept_.begin());
    return image;
  }

 private:
  int64_t Size() const { return std::ssize(kept_); }

  FrameSource source_;
  int64_t max_frames_;
  int64_t max_bytes_;
  std::map<int, std::shared_ptr<const Image>> kept_;
};

}  // namespace regrade
