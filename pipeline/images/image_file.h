// Reads and writes picture files. Readers return a whole picture or throw the reason why there
// is none; all but ReadImage decode in a child process where decoder_process.h says so. Writers
// encode in memory and write atomically. JPEG, PNG and HEIC have decoders of
// our own over libjpeg, libpng and libheif, because OpenImageIO hides their warnings and
// profiles.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "kernels/scene/geo_position.h"
#include "kernels/scene/image.h"
#include "pipeline/images/picture_decoder.h"

namespace regrade {

struct DecodedPhoto {
  Image image;               // RGB, or RGB + straight alpha; sRGB in [0, 1], upright
  double exif_focal_px = 0;  // focal length in pixels from EXIF; 0 where unknown
  int bits = 8;              // per value in the file; 32 means floating point
  int orientation = 1;       // of EXIF, 1..8: how the stored pixels were turned
  std::string taken;         // EXIF's time, "2024:05:01 10:20:30.125"; empty where unknown
  std::optional<GeoPosition> gps;
  double light = 0;    // exposure time x sensitivity / f-number^2; 0 where unknown
  std::string notice;  // remarks for the user; empty if none
  // Of the conversion to sRGB (normalize_photo.h), apart from the notice, because many photos
  // share them.
  std::string colors;
  double clipped = 0;
};

// Decodes a photo; its content decides the format, not its name. Throws Error(kInput) for what
// is not a whole picture: not a regular file (named pipes are never opened), not an image,
// damaged, too large, too small, an undecodable format (with a remedy), NaN, alpha 0
// everywhere. Grey is replicated to 3 channels, EXIF orientation is applied, linear light
// (OpenEXR, HDR) is encoded, colours of a profile or of known primaries are converted to sRGB,
// CMYK is converted without its profile (notice). Camera raw is developed to sRGB with the
// camera's white balance and no automatic brightness.
DecodedPhoto DecodePhoto(const std::string& path, const DecodeLimits& limits = {});

// A picture of any size; 1, 3 or 4 channels as in the file. ReadImage is for pictures that this
// program wrote into its folders, and always decodes in this process.
Image ReadImage(const std::string& path);
Image ReadGivenImage(const std::string& path);

// The style picture: RGB of any size. Transparency is laid over white; `notice` (may be null)
// gets remarks for the user.
Image ReadStylePicture(const std::string& path, std::string* notice);

// 8 bits a channel, 1, 3 or 4 channels. Values are clamped to [0, 1] and rounded half up (NaN
// becomes 0): a picture that was read and is written again keeps its pixels.
std::string EncodePng8(const Image& image);
// The same with 16 bits.
std::string EncodePng16(const Image& image);
// Quality 1..100. 1 or 3 channels.
std::string EncodeJpeg(const Image& image, int quality);

// Encode and write atomically. Throw Error(kResources) if the write fails.
void WritePng8(const std::string& path, const Image& image);
void WritePng16(const std::string& path, const Image& image);

}  // namespace regrade
