// A frame sequence loaded one frame at a time, so that it need not fit in memory.
#pragma once

#include <functional>
#include <string>

#include "kernels/scene/image.h"

namespace regrade {

// `frame(i)` for i in [0, count) returns frame i; it may decode a file and may throw Error.
struct FrameSource {
  int count = 0;
  std::function<Image(int)> frame;
};

struct NamedFrameSource {
  std::string name;  // "source", "views_2d", "styled", ...
  FrameSource frames;
};

}  // namespace regrade
