#include "pipeline/images/normalize_photo.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/scene/srgb.h"
#include "pipeline/images/color_profile.h"

namespace regrade {
namespace {

// Conversions leave white and black this far outside.
constexpr float kRounding = 1e-4f;

void CheckFinite(const Image& image, const std::string& where) {
  const int64_t bad =
      std::ranges::count_if(image.pixels, [](float v) { return !std::isfinite(v); });
  if (bad > 0)
    throw InputError(Concat(bad, " of ", image.pixels.size(), " values are NaN or infinite"),
                     where, "export the picture again without them");
}

void Unpremultiply(Image* image) {
  for (int64_t i = 0; i < image->num_pixels(); ++i) {
    float* p = &image->pixels[4 * i];
    if (p[3] > 0)
      for (int c = 0; c < 3; ++c) p[c] /= p[3];
  }
}

void EncodeSrgb(Image* image) {
  const int colors = std::min(image->channels, 3);
  for (int64_t i = 0; i < image->num_pixels(); ++i)
    for (int c = 0; c < colors; ++c) {
      float& v = image->pixels[i * image->channels + c];
      // Above 1 the curve continues, so that the clamp below counts those values.
      if (v > 0) v = static_cast<float>(SrgbFromLinear(v));
    }
}

// To sRGB's primaries in linear light, by what the file says of its colours: a profile, or
// else code points or chromaticities.
void ConvertColors(StoredPicture* picture) {
  Image* const image = &picture->image;
  std::string problem;
  if (!picture->icc.empty()) {
    picture->colors = LinearizeByProfile(picture->icc, image, &problem);
    if (!problem.empty()) picture->notices.push_back(problem);
  }
  if (picture->icc.empty() || !problem.empty()) {
    if (picture->linear_light) {
      if (picture->chromaticities)
        picture->colors = LinearizeByPrimaries(*picture->chromaticities, image);
      if (picture->colors.empty()) picture->colors = "linear light";
    } else {
      picture->colors = LinearizeByCicp(picture->primaries, picture->transfer, image);
    }
  }
  if (!picture->colors.empty()) EncodeSrgb(image);
}

void Clamp(StoredPicture* picture) {
  int64_t clamped = 0;
  for (float& v : picture->image.pixels) {
    if (!(v >= -kRounding && v <= 1 + kRounding)) ++clamped;
    v = v > 0 ? std::min(v, 1.f) : 0;  // an odd profile makes NaN
  }
  picture->clipped = static_cast<double>(clamped) / picture->image.pixels.size();
}

void CheckAlpha(const Image& image, const std::string& where) {
  for (int64_t i = 0; i < image.num_pixels(); ++i)
    if (image.pixels[4 * i + 3] > 0) return;
  throw InputError("alpha is 0 everywhere: nothing to see", where,
                   "export the picture without alpha");
}

}  // namespace

void ApplyPhotoRules(StoredPicture* picture, const std::string& where) {
  Image& image = picture->image;
  const bool alpha = image.channels == 4;
  if (picture->bits == 32) CheckFinite(image, where);
  if (alpha && picture->premultiplied) Unpremultiply(&image);
  ConvertColors(picture);
  Clamp(picture);
  if (alpha) CheckAlpha(image, where);
  if (picture->orientation != 1) image = Upright(image, picture->orientation);
}

std::string ColorNotice(const std::string& colors, double clipped) {
  std::string text;
  if (!colors.empty()) text = "colours were converted from " + colors + " to sRGB";
  if (clipped > 0)
    text += Format("%s%.3g %% of the values were outside [0, 1] and were clamped",
                   text.empty() ? "" : "; ", 100 * clipped);
  return text;
}

Image Upright(const Image& stored, int orientation) {
  const bool turned = orientation >= 5;  // rows become columns
  const int w = stored.width, h = stored.height;
  Image result(turned ? h : w, turned ? w : h, stored.channels);
  for (int y = 0; y < result.height; ++y)
    for (int x = 0; x < result.width; ++x) {
      int from_x = x, from_y = y;
      switch (orientation) {
        case 2:
          from_x = w - 1 - x;
          break;
        case 3:
          from_x = w - 1 - x, from_y = h - 1 - y;
          break;
        case 4:
          from_y = h - 1 - y;
          break;
        case 5:
          from_x = y, from_y = x;
          break;
        case 6:
          from_x = y, from_y = h - 1 - x;
          break;
        case 7:
          from_x = w - 1 - y, from_y = h - 1 - x;
          break;
        case 8:
          from_x = w - 1 - y, from_y = x;
          break;
        default:
          break;
      }
      std::copy_n(stored.at(from_x, from_y), stored.channels, result.at(x, y));
    }
  return result;
}

Image CompositeOnWhite(const Image& picture) {
  if (picture.channels != 4) return picture;
  Image result(picture.width, picture.height, 3);
  for (int64_t i = 0; i < picture.num_pixels(); ++i) {
    const float* p = &picture.pixels[4 * i];
    for (int c = 0; c < 3; ++c) result.pixels[3 * i + c] = p[3] * p[c] + (1 - p[3]);
  }
  return result;
}

double FocalInPixels(const StoredPicture& picture) {
  const double w = picture.image.width, h = picture.image.height;
  const double longer = std::max(w, h);
  const auto plausible = [&](double focal) {
    return focal > 0.2 * longer && focal < 20 * longer;
  };
  const double from_35mm = picture.focal_35mm * std::hypot(w, h) / std::hypot(36.0, 24.0);
  if (plausible(from_35mm)) return from_35mm;
  // The picture may have been turned or scaled after the camera wrote the tags.
  const double stored_width = picture.orientation >= 5 ? h : w;
  const double scale = picture.exif_width > 0 ? stored_width / picture.exif_width : 1.0;
  const double from_sensor = picture.focal_mm * picture.focal_plane_px_per_mm * scale;
  return plausible(from_sensor) ? from_sensor : 0;
}

}  // namespace regrade
