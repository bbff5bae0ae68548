// Sizes of folders, for people.
#pragma once

#include <cstdint>
#include <string>

namespace regrade {

// Bytes of a file, or of all files below a folder; 0 for what is not there. Links count
// nothing.
uint64_t SizeOnDisk(const std::string& path);

// "231 MB", "1.8 GB", of 10^6 and 10^9 bytes.
std::string SizeText(uint64_t bytes);

}  // namespace regrade
