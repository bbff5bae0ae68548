// How files in the output folder are called.
#pragma once

#include <cstdio>
#include <string>

namespace regrade {

// Sequences of the film's frames stand beside those of the photos' places: frames/path_source/,
// ...
inline constexpr char kPathPrefix[] = "path_";
// Where photos differ in size or lens, frames/common_source/, ... hold the views' frames once
// more, of one camera (kernels/scene/common_camera.h) at each photo's place: neighbouring views
// are compared on these.
inline constexpr char kCommonPrefix[] = "common_";

// "00007.png"
inline std::string FrameName(int index) {
  char name[32];
  std::snprintf(name, sizeof name, "%05d.png", index);
  return name;
}

}  // namespace regrade
