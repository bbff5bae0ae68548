#include "pipeline/capture/photo_names.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>

#include "kernels/base/error.h"
#include "pipeline/files/folder_listing.h"
#include "pipeline/images/image_format.h"

namespace regrade {
namespace {

std::string StemOf(const std::string& name) {
  return std::filesystem::path(name).stem().string();
}

bool HasPictureName(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  for (const char* name : {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".exr"})
    if (extension == name) return true;
  return false;
}

// By content or name, so that a damaged picture is reported rather than ignored.
bool IsMeantAsPicture(const std::string& path) {
  if (HasPictureName(path)) return true;
  std::string begin(4096, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  begin.resize(std::max<std::streamsize>(0, file.gcount()));
  return SniffImageFormat(begin, path) != nullptr;
}

std::string SizeOf(const Image& image) { return Concat(image.width, " x ", image.height); }

}  // namespace

void CheckAspect(const Image& picture, int width, int height, const std::string& where,
                 ExitCode code) {
  // The ratios of the sides may differ by one pixel of the smaller picture.
  const double ratio_x = static_cast<double>(picture.width) / width;
  const double ratio_y = static_cast<double>(picture.height) / height;
  const double larger = std::max(ratio_x, ratio_y);
  const double slack = 1.0 / std::min({width, height, picture.width, picture.height});
  if (std::abs(ratio_x - ratio_y) > slack * larger)
    throw Error(code,
                Concat("has ", SizeOf(picture), " pixels, its view ", width, " x ", height),
                where, "keep the photo's aspect: do not crop or rotate");
}

std::vector<std::string> PicturesByPhotoName(const std::string& folder,
                                             const std::vector<std::string>& photos,
                                             const std::string& what) {
  std::map<std::string, size_t> view_of;
  for (size_t i = 0; i < photos.size(); ++i)
    if (!view_of.emplace(StemOf(photos[i]), i).second)
      throw InputError("two photos have the name \"" + StemOf(photos[i]) + "\"", photos[i],
                       what + "s are found by name: give the photos different names");
  std::vector<std::string> paths(photos.size());
  bool any = false;
  for (const ListedFile& file : ListFolder(folder).files) {
    auto match = view_of.find(StemOf(file.name));
    // IMG_7.jpg.png, as COLMAP names masks.
    if (match == view_of.end() && HasPictureName(StemOf(file.name)))
      match = view_of.find(StemOf(StemOf(file.name)));
    if (match == view_of.end()) continue;
    if (!file.problem.empty()) throw InputError(file.problem, file.path);
    if (!IsMeantAsPicture(file.path)) continue;
    std::string& path = paths[match->second];
    if (!path.empty())
      throw InputError("two " + what + "s for the photo " + photos[match->second],
                       path + " and " + file.path, "leave one of them");
    path = file.path;
    any = true;
  }
  if (!any)
    throw InputError(
        "has no picture with the name of a photo", folder,
        photos.empty() ? "" : "expected are names like " + StemOf(photos[0]) + ".png");
  return paths;
}

}  // namespace regrade
