#include "pipeline/capture/staged_files.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <regex>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "pipeline/images/image_file.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

template <typename Value>
uint64_t PixelHash(const Image& image) {
  Hasher hasher;
  const int shape[3] = {image.width, image.height, image.channels};
  hasher.Add(shape, sizeof shape);
  constexpr float kMax = std::numeric_limits<Value>::max();
  std::vector<Value> values(image.pixels.size());
  std::transform(image.pixels.begin(), image.pixels.end(), values.begin(), [](float v) {
    return static_cast<Value>(std::clamp(v, 0.f, 1.f) * kMax + 0.5f);
  });
  hasher.Add(values.data(), values.size() * sizeof(Value));
  return hasher.Value();
}

// Bit depth of a PNG by its header; 0 if the file ends before.
int PngDepth(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  file.seekg(24);
  char depth = 0;
  return file.get(depth) ? depth : 0;
}

}  // namespace

std::string StagedName(size_t index, const char* suffix) {
  return Format("%05zu%s", index, suffix);
}

uint64_t PixelHash8(const Image& image) { return PixelHash<uint8_t>(image); }

void StagePicture(const std::string& path, const Image& image, int bits) {
  if (fs::exists(path)) {
    try {
      if (PngDepth(path) == bits &&
          PixelHash<uint16_t>(ReadImage(path)) == PixelHash<uint16_t>(image))
        return;
    } catch (const Error&) {
      // Damaged or something else: written anew.
    }
  }
  if (bits == 16)
    WritePng16(path, image);
  else
    WritePng8(path, image);
}

void RenumberStaged(const std::string& folder, size_t from, size_t to) {
  for (const char* suffix : {".png", ".alpha.png"}) {
    const std::string old_path = folder + "/" + StagedName(from, suffix);
    const std::string new_path = folder + "/" + StagedName(to, suffix);
    std::error_code error;
    if (fs::exists(old_path, error))
      fs::rename(old_path, new_path, error);
    else
      fs::remove(new_path, error);
    if (error) throw ResourceError("cannot rename: " + error.message(), old_path);
  }
}

void RemoveLeftovers(const std::string& folder, const std::set<std::string>& staged) {
  static const std::regex kOurs(R"(\d{5,}(\.alpha)?\.png)");
  std::vector<fs::path> leftovers;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (std::regex_match(name, kOurs) && !staged.contains(name))
      leftovers.push_back(entry.path());
  }
  for (const fs::path& path : leftovers) fs::remove(path);
}

}  // namespace regrade
