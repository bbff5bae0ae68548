// What a decoded picture must be before anyone works with it: finite, in range, straight alpha,
// sRGB-encoded, upright.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/image.h"

namespace regrade {

// A picture as a decoder hands it over, with what its file says about it.
struct StoredPicture {
  Image image;                       // 1, 3 or 4 channels
  int bits = 8;                      // a value's width in the file; 32 means floating point
  int orientation = 1;               // EXIF, 1..8
  bool linear_light = false;         // values are light, not sRGB-encoded
  bool premultiplied = false;        // colours are already multiplied by alpha
  double focal_mm = 0;               // EXIF FocalLength; 0 where unknown, as below
  double focal_35mm = 0;             // EXIF FocalLengthIn35mmFilm
  double focal_plane_px_per_mm = 0;  // EXIF FocalPlaneXResolution
  double exif_width = 0;             // EXIF PixelXDimension: the width those pixels refer to
  std::vector<std::string> notices;
};

// Applies the rules in place and appends what was done to the notices. Throws Error(kInput) for
// NaN or infinite values (counted), and for alpha that is 0 everywhere.
void ApplyPhotoRules(StoredPicture* picture, const std::string& where);

// The picture as EXIF orientation 1..8 wants it seen.
Image Upright(const Image& stored, int orientation);

// RGB over white, by straight alpha. Pictures without alpha pass as they are.
Image CompositeOnWhite(const Image& picture);

// Focal length in pixels of the picture (the longer side's pixels; they are square), 0 where
// unknown. The 35 mm equivalent is defined by the frame's diagonal (CIPA DCG-001): 43.27 mm.
// Values outside of 0.2 to 20 times the longer side are taken for nonsense.
double FocalInPixels(const StoredPicture& picture);

}  // namespace regrade
