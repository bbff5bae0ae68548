// Small text files of numbers, as cameras are given in.
#pragma once

#include <string>
#include <vector>

namespace regrade {

// The numbers of each line that has some, separated by white space or commas. Throws
// Error(kInput) with the line: no file, more than 64 KiB, a word that is no number, a number
// that is not finite, or no number at all.
std::vector<std::vector<double>> ReadNumberFile(const std::string& path);

}  // namespace regrade
