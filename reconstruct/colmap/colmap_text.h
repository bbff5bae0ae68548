// COLMAP's text models: cameras.txt, images.txt and points3D.txt.
#pragma once

#include <string>

#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// The bytes that `name`.bin would hold for the text of `name`.txt ("cameras", "images" or
// "points3D"), so that one reader judges both. `path` names the file in errors. Throws
// Error(kInput) with the line for a word that is no number, a line that ends too early, or an
// unknown camera model.
std::string BinaryOfColmapText(const std::string& name, const std::string& text,
                               const std::string& path);

// Writes the three text files into `folder`, which exists; numbers read back exactly. Throws
// Error(kResources) when they do not fit.
void WriteColmapText(const ColmapModel& model, const std::string& folder);

}  // namespace regrade
