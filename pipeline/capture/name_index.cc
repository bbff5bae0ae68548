#include "pipeline/capture/name_index.h"

#include <algorithm>
#include <filesystem>
#include <limits>

#include "pipeline/files/text.h"
#include "pipeline/program/nearest_name.h"

namespace regrade {
namespace {

constexpr size_t kMostCompared = 20000;  // names; each costs its length squared
constexpr size_t kLongestCompared = 200;

void Insert(const std::string& key, const std::string& name,
            std::map<std::string, std::string>* names) {
  const auto [at, is_new] = names->emplace(key, name);
  if (!is_new && at->second != name) at->second.clear();
}

}  // namespace

bool HasPictureName(const std::string& name) {
  const std::string ending = LowerExtension(name);
  for (const char* picture :
       {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".exr", ".heic", ".heif", ".avif",
        ".bmp", ".gif", ".hdr",  ".psd", ".jp2",  ".j2k",  ".ppm", ".pgm",  ".dng",  ".nef",
        ".nrw", ".arw", ".sr2",  ".srf", ".pef",  ".srw",  ".rwl", ".3fr",  ".iiq",  ".erf",
        ".kdc", ".dcr", ".mos",  ".cr2", ".cr3",  ".crw",  ".raf", ".orf",  ".rw2"})
    if (ending == picture) return true;
  return false;
}

std::string WithoutPictureEnding(const std::string& name) {
  return HasPictureName(name) ? std::filesystem::path(name).replace_extension().string() : name;
}

std::string WithSlashes(std::string name) {
  std::ranges::replace(name, '\\', '/');
  return std::filesystem::path(name).lexically_normal().generic_string();
}

NameIndex::NameIndex(const std::vector<std::string>& names) : names_(names) {
  for (const std::string& name : names) {
    same_.emplace(name, name);
    if (!HasPictureName(name)) continue;
    const std::string stem = WithoutPictureEnding(name);
    Insert(stem, name, &other_ending_);
    Insert(LowerCase(name), name, &other_case_);
    Insert(LowerCase(stem), name, &other_case_);
  }
}

std::string NameIndex::Find(const std::string& wanted) const {
  if (same_.contains(wanted)) return wanted;
  const std::string plain = WithSlashes(wanted), stem = WithoutPictureEnding(plain);
  const auto find = [](const auto& names, const std::string& key) {
    const auto found = names.find(key);
    return found == names.end() ? std::string() : found->second;
  };
  std::string name = find(same_, plain);
  if (name.empty()) name = find(other_case_, LowerCase(plain));
  if (name.empty()) name = find(other_ending_, stem);
  if (name.empty()) name = find(other_case_, LowerCase(stem));
  return name;
}

std::string NameIndex::Nearest(const std::string& wanted) const {
  const std::string plain = LowerCase(WithSlashes(wanted)).substr(0, kLongestCompared);
  std::string nearest;
  int least = std::numeric_limits<int>::max();
  for (size_t i = 0; i < std::min(names_.size(), kMostCompared); ++i) {
    const int distance = EditDistance(plain, LowerCase(names_[i]).substr(0, kLongestCompared));
    if (distance >= least) continue;
    least = distance;
    nearest = names_[i];
  }
  return nearest;
}

}  // namespace regrade
