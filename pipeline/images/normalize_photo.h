// Normalises decoded pictures: finite, in [0, 1], straight alpha, sRGB-encoded, upright.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/image.h"

namespace regrade {

// A decoded picture with its metadata.
struct StoredPicture {
  Image image;                       // 1, 3 or 4 channels
  int bits = 8;                      // per value in the file; 32 means floating point
  int orientation = 1;               // EXIF, 1..8
  bool linear_light = false;         // values are not sRGB-encoded
  bool premultiplied = false;        // colours are already multiplied by alpha
  double focal_mm = 0;               // EXIF FocalLength; 0 where unknown, as below
  double focal_35mm = 0;             // EXIF FocalLengthIn35mmFilm
  double focal_plane_px_per_mm = 0;  // EXIF FocalPlaneXResolution
  double exif_width = 0;  // EXIF PixelXDimension: the width that these pixels refer to
  std::vector<std::string> notices;
};

// Normalises in place and appends a notice for each change. Throws Error(kInput) with their
// number for NaN and infinite values, and for alpha that is 0 everywhere.
void ApplyPhotoRules(StoredPicture* picture, const std::string& where);

// The picture turned and mirrored by EXIF orientation 1..8.
Image Upright(const Image& stored, int orientation);

// RGB over white, by straight alpha. Pictures without alpha are unchanged.
Image CompositeOnWhite(const Image& picture);

// Focal length in pixels of the picture, which are square; 0 where unknown. The 35 mm
// equivalent is defined by the frame's diagonal (CIPA DCG-001): 43.27 mm. Values outside 0.2 to
// 20 times the longer side are ignored.
double FocalInPixels(const StoredPicture& picture);

}  // namespace regrade
