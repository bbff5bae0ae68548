// Normalises decoded pictures: finite, in [0, 1], straight alpha, sRGB, upright.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "kernels/scene/geo_position.h"
#include "kernels/scene/image.h"

namespace regrade {

// A decoded picture with its metadata.
struct StoredPicture {
  Image image;                      // 1, 3 or 4 channels
  int bits = 8;                     // per value in the file; 32 means floating point
  int orientation = 1;              // EXIF, 1..8
  std::string taken;                // EXIF DateTimeOriginal with its fraction of a second
  double light = 0;                 // see DecodedPhoto
  bool linear_light = false;        // values are not encoded by a curve
  std::string icc;                  // the colour profile; empty if there is none
  int primaries = 0, transfer = 0;  // ITU-T H.273, if there is no profile; 0: not given
  // x, y of red, green, blue and white, of linear light; of sRGB if it is not given.
  std::optional<std::array<float, 8>> chromaticities;
  bool premultiplied = false;        // colours are already multiplied by alpha
  double focal_mm = 0;               // EXIF FocalLength; 0 where unknown, as below
  double focal_35mm = 0;             // EXIF FocalLengthIn35mmFilm
  double focal_plane_px_per_mm = 0;  // EXIF FocalPlaneXResolution
  double exif_width = 0;  // EXIF PixelXDimension: the width that these pixels refer to
  std::optional<GeoPosition> gps;
  std::vector<std::string> notices;
  std::string colors;  // what the colours were converted from: "Display P3"; empty if unchanged
  double clipped = 0;  // fraction of the values that were outside [0, 1] then, and were clamped
};

// Normalises in place and says what was changed. Throws Error(kInput) with their
// number for NaN and infinite values, and for alpha that is 0 everywhere.
void ApplyPhotoRules(StoredPicture* picture, const std::string& where);

// "colours were converted from Display P3 to sRGB; 0.3 % of the values were outside [0, 1] and
// were clamped"; empty if nothing of that was done.
std::string ColorNotice(const std::string& colors, double clipped);

// The picture turned and mirrored by EXIF orientation 1..8.
Image Upright(const Image& stored, int orientation);

// RGB over white, by straight alpha. Pictures without alpha are unchanged.
Image CompositeOnWhite(const Image& picture);

// Focal length in pixels of the picture, which are square; 0 where unknown. The 35 mm
// equivalent is defined by the frame's diagonal (CIPA DCG-001): 43.27 mm. Values outside 0.2 to
// 20 times the longer side are ignored.
double FocalInPixels(const StoredPicture& picture);

}  // namespace regrade
