#include "pipeline/capture/given_colmap_model.h"

#include <algorithm>
#include <cstdint>

#include "kernels/base/error.h"
#include "kernels/base/natural_order.h"
#include "pipeline/capture/picture_folders.h"
#include "pipeline/files/folder_listing.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr int kDeepest = 3;           // folders below PHOTOS
constexpr size_t kMostFolders = 500;  // that are looked into

std::vector<fs::path> InnerFolders(const fs::path& folder) {
  std::vector<fs::path> folders;
  std::error_code error;  // a folder that cannot be listed holds no model
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    if (std::error_code none; it->is_directory(none) && !it->is_symlink(none))
      folders.push_back(it->path());
  std::ranges::sort(folders, [](const fs::path& a, const fs::path& b) {
    return NaturalLess(a.string(), b.string());
  });
  return folders;
}

// The models in `folders` and their subfolders.
std::vector<fs::path> ModelsIn(const std::vector<fs::path>& folders) {
  std::vector<fs::path> models;
  for (const fs::path& folder : folders) {
    if (HoldsColmapModel(folder)) models.push_back(folder);
    for (const fs::path& numbered : InnerFolders(folder))
      if (HoldsColmapModel(numbered)) models.push_back(numbered);
  }
  return models;
}

}  // namespace

bool HoldsColmapModel(const fs::path& folder) {
  std::error_code error;
  for (const char* ending : {".bin", ".txt"})
    if (fs::is_regular_file(folder / (std::string("cameras") + ending), error) &&
        fs::is_regular_file(folder / (std::string("images") + ending), error))
      return true;
  return false;
}

GivenColmapModel FindColmapModel(const fs::path& root) {
  GivenColmapModel given;
  given.pictures = PictureFolder(root);
  std::vector<fs::path> models;
  if (!given.pictures.empty()) {
    models = ModelsIn({root / "sparse", root / "colmap/sparse"});
    if (HoldsColmapModel(root)) models.insert(models.begin(), root);
  }
  if (std::error_code none; models.empty() && fs::is_directory(root / "input", none)) {
    given.pictures = root / "input";
    models = ModelsIn({root / "distorted/sparse"});
  }
  if (models.empty()) return {};
  uint64_t most = 0;
  given.model = models[0];
  for (const fs::path& model : models)
    if (const uint64_t photos = CountColmapImages(model); photos > most) {
      most = photos;
      given.model = model;
    }
  if (models.size() > 1)
    given.note = Concat(
        "of ", models.size(), " COLMAP models ", given.model.lexically_relative(root).string(),
        " is taken, which has the most photos (", most, "); ", models.size() - 1,
        (models.size() == 2 ? " other is" : " others are"), " not used");
  return given;
}

fs::path ColmapModelElsewhere(const fs::path& root) {
  std::vector<std::pair<fs::path, int>> folders{{root, 0}};
  for (size_t i = 0; i < folders.size() && folders.size() < kMostFolders; ++i) {
    const auto [folder, depth] = folders[i];
    if (HoldsColmapModel(folder)) return folder;
    if (depth == kDeepest) continue;
    for (const fs::path& inner : InnerFolders(folder))
      if (!inner.filename().string().starts_with('.') && !IsRunFolder(inner.string()))
        folders.emplace_back(inner, depth + 1);
  }
  return {};
}

}  // namespace regrade
