// Options of `regrade contact-sheet`.
#pragma once

#include <string>

#include "kernels/base/options.h"

namespace regrade {

struct SheetOptions {
  std::string out;
  int views = 3;
  int size = 320;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out, {.help = "the picture to write, a PNG file"});
    bind("views", views,
         {.unit = "photos",
          .help = "photos shown of each style, evenly spaced",
          .min = 1,
          .max = 100});
    bind("size", size,
         {.unit = "pixels",
          .help = "longer side of each picture on the sheet",
          .min = 64,
          .max = 4096});
  }
};

}  // namespace regrade
