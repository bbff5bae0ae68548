// Reads and writes picture files. Readers take anything a folder may hold and either give a
// whole picture or say what is wrong; writers encode in memory and write through one checked
// layer.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "kernels/scene/image.h"

namespace regrade {

struct DecodeLimits {
  int64_t max_pixels = 128'000'000;  // checked from the header, before pixels are allocated
  int min_side = 64;                 // pixels
  bool accept_damaged = false;       // JPEG with lost parts: taken with a notice, not refused
};

struct DecodedPhoto {
  Image image;               // RGB, or RGB + straight alpha; sRGB in [0, 1], upright
  double exif_focal_px = 0;  // focal length in pixels from EXIF; 0 where unknown
  int bits = 8;              // of a value in the file; 32 means floating point
  std::string notice;        // what a person may want to know; empty if nothing
};

// Decodes a photo by its content, whatever its name. Throws Error(kInput) with the reason for
// everything that is not a whole picture: not a regular file (a named pipe is never opened),
// not an image, damaged, too large, too small, an undecodable format (the hint says what to
// do), NaN, alpha 0 everywhere. Grey is replicated to 3 channels, EXIF orientation is applied,
// linear light (OpenEXR, HDR) is encoded, CMYK is converted without its profile (notice), other
// colour profiles are named but not applied (notice).
DecodedPhoto DecodePhoto(const std::string& path, const DecodeLimits& limits = {});

// A picture of any size: 1, 3 or 4 channels as in the file (grey stays 1).
Image ReadImage(const std::string& path);

// The picture whose style is wanted: RGB of any size. Transparency is laid over white; `notice`
// (may be null) gets what a person may want to know.
Image ReadStylePicture(const std::string& path, std::string* notice);

// 8 bits a channel; values are clamped to [0, 1] and rounded half up (NaN becomes 0), so that
// writing what was read gives the same pixels. 1, 3 or 4 channels.
std::string EncodePng8(const Image& image);
// The same with 16 bits: for depth, masks and the like.
std::string EncodePng16(const Image& image);
// Quality 1..100. 1 or 3 channels.
std::string EncodeJpeg(const Image& image, int quality);

// Encode and write atomically. Throw Error(kResources) when the disk does not take it.
void WritePng8(const std::string& path, const Image& image);
void WritePng16(const std::string& path, const Image& image);

}  // namespace regrade
