#include "pipeline/capture/photo_masks.h"

#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "pipeline/capture/mask_picture.h"
#include "pipeline/capture/photo_names.h"
#include "pipeline/images/image_file.h"

namespace regrade {
namespace {

// White where a photo is used, black elsewhere.
Image KeptPart(const std::string& path, const StagedPhoto& photo) {
  Image mask = ReadMask(path);
  CheckAspect(mask, photo.width, photo.height, path, ExitCode::kInput);
  const float largest = *std::ranges::max_element(mask.pixels);
  if (mask.width != photo.width || mask.height != photo.height)
    mask = Resize(mask, photo.width, photo.height);
  for (float& value : mask.pixels) value = value < 0.5f ? 0.0f : 1.0f;
  if (std::ranges::all_of(mask.pixels, [](float value) { return value == 0; }))
    throw InputError(
        largest > 0 ? Format("has nothing brighter than mid-grey: its largest "
                             "value is %.3g of 255",
                             255 * largest)
                    : "is entirely black",
        path,
        largest > 0 ? "write 255 for white" : "remove the photo if none of it is to be used");
  return mask;
}

}  // namespace

int StageMasks(const std::vector<std::string>& masks, const std::vector<StagedPhoto>& photos,
               const std::string& folder) {
  REGRADE_CHECK_EQ(masks.size(), photos.size());
  std::filesystem::remove_all(folder);  // of an earlier run
  std::filesystem::create_directories(folder);
  int count = 0;
  for (size_t i = 0; i < photos.size(); ++i) {
    if (masks[i].empty()) continue;
    WritePng8(folder + "/" + photos[i].name + ".png", KeptPart(masks[i], photos[i]));
    ++count;
  }
  return count;
}

int StagePhotoMasks(const std::string& masks, const std::vector<StagedPhoto>& photos,
                    const std::string& folder) {
  std::vector<std::string> files;
  for (const StagedPhoto& photo : photos) files.push_back(photo.file);
  return StageMasks(PicturesByPhotoName(masks, files, "mask"), photos, folder);
}

std::string StagedMaskOf(const std::string& photo_path) {
  const std::filesystem::path path(photo_path);
  return (path.parent_path().parent_path() / "masks" / path.filename()).string() + ".png";
}

}  // namespace regrade
