// Decodes PNG files with libpng's remarks in hand: left to itself it prints them on the
// terminal.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "kernels/scene/image.h"

namespace regrade {

struct PngPicture {
  Image image;  // as stored: 1 channel, 3, or 4 with straight alpha
  int bits = 8;
  bool linear_light = false;  // the file says that its values are light
  std::string exif;           // a TIFF block; empty if there is none
  std::string icc;            // the colour profile; empty if there is none
  int64_t remarks = 0;        // of the decoder, none of which costs a pixel
  std::string first_remark;
};

// Called with width, height and bytes per pixel from the header, before any pixel is allocated;
// throws to refuse.
using PngSizeCheck = std::function<void(int64_t width, int64_t height, int64_t pixel_bytes)>;

// Throws Error(kInput) for what libpng cannot decode.
PngPicture DecodePng(std::string_view bytes, const std::string& where,
                     const PngSizeCheck& check);

}  // namespace regrade
