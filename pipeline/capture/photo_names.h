// Pictures that belong to photos by their names: masks, and styled pictures of other programs.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/scene/image.h"

namespace regrade {

// The picture in `folder` for each photo, by the names' stems, the photo's own extension kept
// or not (IMG_7.jpg.png); empty where there is none. Of photos with one name in different
// folders that one is meant whose folders the picture's path has (cam0/IMG_7.jpg.png). `what`
// names such pictures ("mask"). Throws as MakeFolderStylizer does.
std::vector<std::string> PicturesByPhotoName(const std::string& folder,
                                             const std::vector<std::string>& photos,
                                             const std::string& what);

// Throws Error(code) if the sides of `picture` have another ratio than width and height.
void CheckAspect(const Image& picture, int width, int height, const std::string& where,
                 ExitCode code);

}  // namespace regrade
