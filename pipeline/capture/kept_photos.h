// Photos at working size that several stages read, so that each is decoded at full size once.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "kernels/scene/image.h"

namespace regrade {

// For any number of threads.
class KeptPhotos {
 public:
  // The first pictures are kept, up to that many bytes of them.
  explicit KeptPhotos(int64_t most_bytes) : most_bytes_(most_bytes) {}

  // The photo of that file, longer side `size` pixels: the one that is kept, or else what
  // `decode` returns, which passes its errors on.
  Image At(const std::string& path, int size, const std::function<Image()>& decode);

  // How often photos were decoded, and how often one was there.
  int64_t decoded() const;
  int64_t taken() const;

 private:
  const int64_t most_bytes_;
  mutable std::mutex mutex_;
  std::map<std::pair<std::string, int>, Image> photos_;
  int64_t bytes_ = 0, decoded_ = 0, taken_ = 0;
};

}  // namespace regrade
