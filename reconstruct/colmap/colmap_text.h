// Reads and writes COLMAP's text models: cameras.txt, images.txt and points3D.txt.
#pragma once

#include <cstdint>
#include <string>

#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// Converts the text of `name`.txt ("cameras", "images" or "points3D") to the bytes of
// `name`.bin, so that one reader validates both. `path` names the file in errors. Throws
// Error(kInput) with the line for an invalid number, an incomplete line, or an unknown camera
// model.
std::string BinaryOfColmapText(const std::string& name, const std::string& text,
                               const std::string& path);

// The images that the text of images.txt has, without reading them.
uint64_t CountTextImages(const std::string& text);

// Writes the three text files into the existing `folder`; numbers are read back exactly. Throws
// Error(kResources) if the disk is full.
void WriteColmapText(const ColmapModel& model, const std::string& folder);

}  // namespace regrade
