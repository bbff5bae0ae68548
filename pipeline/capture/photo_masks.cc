#include "pipeline/capture/photo_masks.h"

#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "pipeline/capture/photo_names.h"
#include "pipeline/images/image_file.h"

namespace regrade {

int StagePhotoMasks(const std::string& masks, const std::vector<StagedPhoto>& photos,
                    const std::string& folder) {
  std::vector<std::string> files;
  for (const StagedPhoto& photo : photos) files.push_back(photo.file);
  const std::vector<std::string> paths = PicturesByPhotoName(masks, files, "mask");
  std::filesystem::remove_all(folder);  // of an earlier run
  std::filesystem::create_directories(folder);
  int count = 0;
  for (size_t i = 0; i < photos.size(); ++i) {
    if (paths[i].empty()) continue;
    const StagedPhoto& photo = photos[i];
    Image mask = ReadGivenImage(paths[i]);
    CheckAspect(mask, photo.width, photo.height, paths[i], ExitCode::kInput);
    if (mask.width != photo.width || mask.height != photo.height)
      mask = Resize(mask, photo.width, photo.height);
    Image keep(photo.width, photo.height, 1);
    bool keeps_any = false;
    const int colors = std::min(mask.channels, 3);
    for (int64_t p = 0; p < keep.num_pixels(); ++p) {
      float sum = 0;
      for (int c = 0; c < colors; ++c) sum += mask.pixels[p * mask.channels + c];
      keep.pixels[p] = sum < 0.5f * static_cast<float>(colors) ? 0.0f : 1.0f;
      keeps_any |= keep.pixels[p] > 0;
    }
    if (!keeps_any)
      throw InputError("is entirely black", paths[i],
                       "remove the photo if none of it is to be used");
    WritePng8(folder + "/" + photo.name + ".png", keep);
    ++count;
  }
  return count;
}

std::string StagedMaskOf(const std::string& photo_path) {
  const std::filesystem::path path(photo_path);
  return (path.parent_path().parent_path() / "masks" / path.filename()).string() + ".png";
}

}  // namespace regrade
