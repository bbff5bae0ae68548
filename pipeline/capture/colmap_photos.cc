#include "pipeline/capture/colmap_photos.h"

#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/images/image_file.h"

namespace regrade {

std::vector<StagedPhoto> PhotosForColmap(const std::vector<StagedPhoto>& photos,
                                         const std::string& folder) {
  namespace fs = std::filesystem;
  std::error_code error;
  fs::remove_all(folder, error);  // of an earlier run
  if (std::ranges::all_of(photos, [](const StagedPhoto& photo) { return photo.bits == 8; }))
    return photos;
  fs::create_directories(folder, error);
  std::vector<StagedPhoto> copies = photos;
  for (StagedPhoto& photo : copies) {
    const std::string path = folder + "/" + photo.name;
    if (photo.bits == 8) {
      fs::copy_file(photo.path, path, error);
      if (error) throw ResourceError(error.message(), path);
    } else {
      WritePng8(path, ReadImage(photo.path));
    }
    photo.path = path;
    photo.bits = 8;
  }
  return copies;
}

}  // namespace regrade
