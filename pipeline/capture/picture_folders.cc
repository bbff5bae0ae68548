#include "pipeline/capture/picture_folders.h"

#include <algorithm>

#include "kernels/base/natural_order.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

// Names of folders in natural order. The caller reports a folder that cannot be listed.
std::vector<std::string> FoldersIn(const fs::path& root) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator it(root, error), end; !error && it != end; it.increment(error))
    if (std::error_code none; it->is_directory(none))
      names.push_back(it->path().filename().string());
  std::ranges::sort(names, NaturalLess);
  return names;
}

// images_4, images_1008x756
bool IsOtherSize(const std::string& name) {
  constexpr std::string_view kPrefix = "images_";
  return name.size() > kPrefix.size() && name.starts_with(kPrefix) &&
         name[kPrefix.size()] >= '0' && name[kPrefix.size()] <= '9';
}

bool IsNoPhotos(const std::string& name) {
  const std::string lower = LowerCase(name);
  for (const char* other : {"corrected_images", "depth", "depths", "depth_maps", "confidence",
                            "confidences", "normals", "mask", "masks"})
    if (lower == other) return true;
  return IsOtherSize(lower);
}

// Of the full size; empty if there is none.
fs::path MainFolder(const fs::path& root) {
  std::error_code none;
  for (const char* name : {"images", "rgb", "image"})
    if (fs::is_directory(root / name, none)) return root / name;
  return {};
}

}  // namespace

fs::path PictureFolder(const fs::path& root) {
  if (const fs::path main = MainFolder(root); !main.empty()) return main;
  for (const std::string& name : FoldersIn(root))
    if (IsOtherSize(name)) return root / name;
  return {};
}

std::vector<fs::path> FoldersBesidePictures(const fs::path& root) {
  std::vector<fs::path> folders;
  if (MainFolder(root).empty()) return folders;
  for (const std::string& name : FoldersIn(root))
    if (IsNoPhotos(name)) folders.push_back(root / name);
  return folders;
}

}  // namespace regrade
