// How files in the output folder are called.
#pragma once

#include <cstdio>
#include <string>

namespace regrade {

// Sequences of the film's frames stand beside those of the photos' places: frames/path_source/,
// ...
inline constexpr char kPathPrefix[] = "path_";

// "00007.png"
inline std::string FrameName(int index) {
  char name[32];
  std::snprintf(name, sizeof name, "%05d.png", index);
  return name;
}

}  // namespace regrade
