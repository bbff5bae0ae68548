// What OpenImageIO's WebP decoder does not tell: the size, before it allocates the picture, and
// the file's metadata.
#pragma once

#include <cstdint>
#include <string_view>

namespace regrade {

struct WebpHeader {
  int64_t width = 0, height = 0;  // of the canvas, pixels; 0 if the file does not say
  std::string_view exif;          // a TIFF block, or "Exif\0\0" and one; empty if there is none
  std::string_view icc;           // the colour profile; empty if there is none
};

// The views point into `bytes`. A damaged file has fewer of the values.
WebpHeader ReadWebpHeader(std::string_view bytes);

}  // namespace regrade
