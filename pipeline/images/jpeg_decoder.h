// Decodes JPEG files with libjpeg and counts its warnings: it returns a full-size picture even
// for half a file.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "kernels/scene/image.h"
#include "pipeline/images/image_format.h"

namespace regrade {

struct JpegPicture {
  Image image;  // as stored (EXIF orientation not applied): 1 channel, or 3 in RGB
  bool from_cmyk = false;
  std::string exif;  // the block "Exif\0\0..."; empty if there is none
  std::string icc;   // the colour profile; empty if there is none
  // Warnings about lost or invented pixels. Warnings about odd headers are not counted.
  int64_t damage_warnings = 0;
  std::string first_warning;
};

// Throws Error(kInput) for files that are no JPEG, are unsupported (12 bits) or have more than
// kMaxJpegScans scans: each scan costs a pass over the whole picture.
JpegPicture DecodeJpeg(std::string_view bytes, const std::string& where,
                       const PictureSizeCheck& check);

inline constexpr int kMaxJpegScans = 100;  // encoders write about 10

}  // namespace regrade
