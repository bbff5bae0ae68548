// The files of staged photos: written only where they differ, renumbered, cleared of leftovers.
#pragma once

#include <cstdint>
#include <set>
#include <string>

#include "kernels/scene/image.h"

namespace regrade {

// "00007.png", "00007.alpha.png"
std::string StagedName(size_t index, const char* suffix);

// Of size and values as integers of 8 bits, so that a photo and its staged PNG agree.
uint64_t PixelHash8(const Image& image);

// Writes the picture with 8 or 16 bits a channel unless the file already holds these pixels at
// this depth.
void StagePicture(const std::string& path, const Image& image, int bits);

// Gives the staged photo and its alpha, if it has one, a lower number that is free.
void RenumberStaged(const std::string& folder, size_t from, size_t to);

// Deletes staged files of earlier calls.
void RemoveLeftovers(const std::string& folder, const std::set<std::string>& staged);

}  // namespace regrade
