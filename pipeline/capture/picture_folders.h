// Which folders of a capture hold its photos, and which hold something else beside them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace regrade {

// images/, rgb/ or image/ in `root`, or else the first of images_2/, images_4/ and so on; empty
// if there is none.
std::filesystem::path PictureFolder(const std::filesystem::path& root);

// Folders beside images/, rgb/ or image/ that are no photos of their own: the same pictures in
// other sizes (images_4), or undistorted, depth, confidence, normals, masks. Empty where there
// is none of the three. In natural order.
std::vector<std::filesystem::path> FoldersBesidePictures(const std::filesystem::path& root);

}  // namespace regrade
