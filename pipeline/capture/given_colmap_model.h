// COLMAP's models in a folder of photos.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace regrade {

struct GivenColmapModel {
  std::filesystem::path model;     // empty: there is none
  std::filesystem::path pictures;  // the folder that its names are relative to
  std::string note;                // which of several was chosen; empty for one
};

// The model with the most photos, binary or text: of the folder itself, sparse/ and
// colmap/sparse/ with the numbered models in each, whose pictures are in images/ and the like;
// or else of distorted/sparse/, whose pictures are in input/.
GivenColmapModel FindColmapModel(const std::filesystem::path& root);

// Whether a folder holds cameras and images of a model.
bool HoldsColmapModel(const std::filesystem::path& folder);

// A model elsewhere below the folder, at most three folders down; empty if there is none.
std::filesystem::path ColmapModelElsewhere(const std::filesystem::path& root);

}  // namespace regrade
