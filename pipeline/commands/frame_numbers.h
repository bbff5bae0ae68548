// The numbers of frames in the names of their files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace regrade {

struct FrameNumber {
  int64_t number = 0;
  size_t digits = 0;  // as written, zeros included
};

// The number of each frame, whatever its zeros in front: names, in natural order, that differ
// in runs of digits only, extensions aside, and the run that differs ("scene2_0001.png",
// "scene2_0002.png": 1, 2). Where several runs differ, the first one that increases from name
// to name. Empty where there is no such run: then names are only names.
std::vector<FrameNumber> FrameNumbers(const std::vector<std::string>& names);

// A file's name without its extension, which has a letter: "a.0001" has none.
std::string FrameStem(const std::string& name);

// "00042": as many digits as a number in a name has.
std::string PaddedNumber(int64_t number, size_t digits);

}  // namespace regrade
