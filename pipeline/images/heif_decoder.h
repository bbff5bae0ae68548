// Decodes HEIC and AVIF files with libheif: OpenImageIO 2.4 drops their colour profiles.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "kernels/scene/image.h"
#include "pipeline/images/image_format.h"

namespace regrade {

struct HeifPicture {
  Image image;  // RGB, or RGB + alpha; upright: turned and mirrored as the file says
  int bits = 8;
  bool premultiplied = false;
  std::string exif;                 // a TIFF block; empty if there is none
  std::string icc;                  // the colour profile; empty if there is none
  int primaries = 0, transfer = 0;  // ITU-T H.273; 0: not given
  int pictures = 1;                 // in the file; the primary one is decoded
};

// Throws Error(kInput) for files that are damaged or that libheif here cannot decode.
HeifPicture DecodeHeif(std::string_view bytes, const std::string& where,
                       const PictureSizeCheck& check);

}  // namespace regrade
