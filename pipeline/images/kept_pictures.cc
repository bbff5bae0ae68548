#include "pipeline/images/kept_pictures.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <utility>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/base/parallel_tasks.h"
#include "pipeline/images/image_file.h"

namespace regrade {
namespace {

// Quotients as decoders make them.
const std::array<float, 256>& Levels() {
  static const std::array<float, 256> levels = [] {
    std::array<float, 256> table;
    for (int k = 0; k < 256; ++k) table[k] = static_cast<float>(k) / 255.0f;
    return table;
  }();
  return levels;
}

// Empty where a value is no level.
std::vector<uint8_t> BytesOf(const std::vector<float>& values) {
  std::vector<uint8_t> bytes(values.size());
  for (size_t i = 0; i < values.size(); ++i) {
    if (!(values[i] >= 0 && values[i] <= 1)) return {};  // NaN, too
    bytes[i] = static_cast<uint8_t>(values[i] * 255.0f + 0.5f);
    if (Levels()[bytes[i]] != values[i]) return {};
  }
  return bytes;
}

}  // namespace

// Either the bytes or the values of a picture.
struct KeptPictures::Stored {
  Image picture;  // without pixels where there are bytes
  std::vector<uint8_t> bytes;
};

struct KeptPictures::Shared {
  int64_t bytes_left = 0;
  std::map<std::string, Stored> pictures;
};

KeptPictures::KeptPictures(Origin origin, int64_t most_bytes)
    : origin_(origin), shared_(std::make_shared<Shared>()) {
  shared_->bytes_left = most_bytes;
}

Image KeptPictures::Read(const std::string& path) const {
  if (const auto found = shared_->pictures.find(path); found != shared_->pictures.end()) {
    Image picture = found->second.picture;
    const std::vector<uint8_t>& bytes = found->second.bytes;
    if (picture.pixels.empty()) {
      picture.pixels.resize(bytes.size());
      for (size_t i = 0; i < bytes.size(); ++i) picture.pixels[i] = Levels()[bytes[i]];
    }
    return picture;
  }
  Image picture = Decode(path);
  Keep(path, picture);
  return picture;
}

void KeptPictures::ReadAhead(const std::vector<std::string>& paths) const {
  std::vector<std::string> missing;
  for (const std::string& path : paths)
    if (!shared_->pictures.contains(path)) missing.push_back(path);
  int64_t at_once = 1;  // the first one's size decides for the others
  for (int64_t begin = 0; begin < std::ssize(missing) && shared_->bytes_left > 0;) {
    std::vector<Image> pictures(
        static_cast<size_t>(std::min(at_once, std::ssize(missing) - begin)));
    ParallelTasks(0, std::ssize(pictures), [&](int64_t i) {
      try {
        pictures[static_cast<size_t>(i)] = Decode(missing[static_cast<size_t>(begin + i)]);
      } catch (const Error&) {
      }
    });
    for (const Image& picture : pictures) {
      if (!picture.empty()) Keep(missing[static_cast<size_t>(begin)], picture);
      ++begin;
    }
    at_once = TasksAtOnce(std::ssize(pictures[0].pixels) * int64_t{sizeof(float)});
  }
}

Image KeptPictures::Decode(const std::string& path) const {
  return origin_ == Origin::kOurs ? ReadImage(path) : ReadGivenImage(path);
}

void KeptPictures::Keep(const std::string& path, const Image& picture) const {
  if (shared_->bytes_left <= 0) return;
  Stored stored;
  stored.bytes = BytesOf(picture.pixels);
  if (stored.bytes.empty()) {
    stored.picture = picture;
  } else {
    stored.picture.width = picture.width;
    stored.picture.height = picture.height;
    stored.picture.channels = picture.channels;
  }
  const int64_t size = std::ssize(stored.bytes) +
                       std::ssize(stored.picture.pixels) * static_cast<int64_t>(sizeof(float));
  if (size > shared_->bytes_left) return;
  shared_->bytes_left -= size;
  shared_->pictures.emplace(path, std::move(stored));
}

}  // namespace regrade
