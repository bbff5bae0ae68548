#include "pipeline/capture/kept_photos.h"

namespace regrade {

Image KeptPhotos::At(const std::string& path, int size, const std::function<Image()>& decode) {
  const std::pair key(path, size);
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = photos_.find(key); found != photos_.end()) {
      ++taken_;
      return found->second;
    }
  }
  Image photo = decode();
  const std::lock_guard lock(mutex_);
  ++decoded_;
  const int64_t bytes = static_cast<int64_t>(photo.pixels.size() * sizeof(float));
  if (bytes_ + bytes <= most_bytes_ && photos_.emplace(key, photo).second) bytes_ += bytes;
  return photo;
}

int64_t KeptPhotos::decoded() const {
  const std::lock_guard lock(mutex_);
  return decoded_;
}

int64_t KeptPhotos::taken() const {
  const std::lock_guard lock(mutex_);
  return taken_;
}

}  // namespace regrade
