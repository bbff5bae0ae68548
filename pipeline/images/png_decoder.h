// Decodes PNG files with libpng; its warnings are returned instead of printed.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "kernels/scene/image.h"
#include "pipeline/images/image_format.h"

namespace regrade {

struct PngPicture {
  Image image;  // as stored: 1 channel, 3, or 4 with straight alpha
  int bits = 8;
  bool linear_light = false;        // the file marks its values as linear
  std::string exif;                 // a TIFF block; empty if there is none
  std::string icc;                  // the colour profile; empty if there is none
  int primaries = 0, transfer = 0;  // ITU-T H.273, in place of a profile; 0: not given
  int64_t remarks = 0;              // warnings of the decoder; no pixel is affected
  std::string first_remark;
};

// Every chunk up to IEND must be whole and have the right checksum; bytes after IEND are
// ignored. Throws Error(kInput) otherwise, and for files that libpng cannot decode.
PngPicture DecodePng(std::string_view bytes, const std::string& where,
                     const PictureSizeCheck& check);

}  // namespace regrade
