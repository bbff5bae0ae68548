#include "pipeline/images/image_file.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/decoder_process.h"
#include "pipeline/images/normalize_photo.h"
#include "pipeline/images/picture_decoder.h"
#include "pipeline/images/picture_encoder.h"

namespace regrade {
namespace {

// A file of unknown origin.
StoredPicture ReadStored(const std::string& path, const DecodeLimits& limits) {
  return DecodesApart() ? DecodePictureApart(path, limits) : DecodePicture(path, limits);
}

constexpr DecodeLimits kAnySize = {.max_pixels = 1'000'000'000, .min_side = 1};

Image ReplicateGrey(const Image& grey) {
  if (grey.channels != 1) return grey;
  Image result(grey.width, grey.height, 3);
  for (int64_t i = 0; i < grey.num_pixels(); ++i)
    std::fill_n(&result.pixels[3 * i], 3, grey.pixels[i]);
  return result;
}

// Fast and nearly as small as the default of 6 on photographs.
constexpr int kPngLevel = 3;

}  // namespace

DecodedPhoto DecodePhoto(const std::string& path, const DecodeLimits& limits) {
  StoredPicture stored = ReadStored(path, limits);
  DecodedPhoto photo;
  photo.exif_focal_px = FocalInPixels(stored);
  photo.bits = stored.bits;
  photo.orientation = stored.orientation;
  photo.taken = stored.taken;
  photo.gps = stored.gps;
  photo.light = stored.light;
  photo.notice = Join(stored.notices, "; ");
  photo.colors = stored.colors;
  photo.clipped = stored.clipped;
  photo.image = ReplicateGrey(stored.image);
  return photo;
}

Image ReadImage(const std::string& path) { return DecodePicture(path, kAnySize).image; }

Image ReadGivenImage(const std::string& path) { return ReadStored(path, kAnySize).image; }

Image ReadStylePicture(const std::string& path, std::string* notice) {
  StoredPicture stored = ReadStored(path, {.min_side = 1});
  if (stored.image.channels == 4)
    stored.notices.push_back("its transparent parts are laid over white");
  if (const std::string colors = ColorNotice(stored.colors, stored.clipped); !colors.empty())
    stored.notices.push_back(colors);
  if (notice) *notice = Join(stored.notices, "; ");
  return CompositeOnWhite(ReplicateGrey(stored.image));
}

std::string EncodePng8(const Image& image) { return EncodePng(image, 8, kPngLevel, false); }
std::string EncodePng16(const Image& image) { return EncodePng(image, 16, kPngLevel, false); }
std::string EncodeJpeg(const Image& image, int quality) {
  return EncodeJpeg(image, quality, false);
}

void WritePng8(const std::string& path, const Image& image) {
  WriteFileAtomically(path, EncodePng8(image));
}
void WritePng16(const std::string& path, const Image& image) {
  WriteFileAtomically(path, EncodePng16(image));
}

}  // namespace regrade
