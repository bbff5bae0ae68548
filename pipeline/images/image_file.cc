#include "pipeline/images/image_file.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/decoder_process.h"
#include "pipeline/images/normalize_photo.h"
#include "pipeline/images/picture_decoder.h"

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

template <typename Value>
std::string Encode(const char* format, const Image& image, OIIO::ImageSpec spec) {
  constexpr float kMax = std::numeric_limits<Value>::max();
  std::vector<Value> values(image.pixels.size());
  std::transform(image.pixels.begin(), image.pixels.end(), values.begin(), [](float v) {
    return v > 0 ? static_cast<Value>(std::min(v, 1.f) * kMax + 0.5f) : Value{0};
  });
  std::vector<unsigned char> bytes;
  OIIO::Filesystem::IOVecOutput memory(bytes);
  std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(format);
  REGRADE_CHECK(output != nullptr);
  output->set_ioproxy(&memory);
  const OIIO::TypeDesc type = OIIO::BaseTypeFromC<Value>::value;
  if (!output->open(std::string("memory.") + format, spec) ||
      !output->write_image(type, values.data()) || !output->close())
    throw ResourceError(std::string("cannot encode ") + format + ": " + output->geterror());
  return {bytes.begin(), bytes.end()};
}

template <typename Value>
std::string EncodePng(const Image& image) {
  OIIO::ImageSpec spec(image.width, image.height, image.channels,
                       OIIO::BaseTypeFromC<Value>::value);
  spec["oiio:UnassociatedAlpha"] = 1;
  // Fast and nearly as small as the default of 6 on photographs.
  spec["png:compressionLevel"] = 3;
  return Encode<Value>("png", image, spec);
}

}  // namespace

DecodedPhoto DecodePhoto(const std::string& path, const DecodeLimits& limits) {
  StoredPicture stored = ReadStored(path, limits);
  DecodedPhoto photo;
  photo.exif_focal_px = FocalInPixels(stored);
  photo.bits = stored.bits;
  photo.orientation = stored.orientation;
  photo.taken = stored.taken;
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

std::string EncodePng8(const Image& image) { return EncodePng<uint8_t>(image); }
std::string EncodePng16(const Image& image) { return EncodePng<uint16_t>(image); }

std::string EncodeJpeg(const Image& image, int quality) {
  REGRADE_CHECK_LE(image.channels, 3);
  OIIO::ImageSpec spec(image.width, image.height, image.channels, OIIO::TypeDesc::UINT8);
  spec["Compression"] = "jpeg:" + std::to_string(quality);
  return Encode<uint8_t>("jpeg", image, spec);
}

void WritePng8(const std::string& path, const Image& image) {
  WriteFileAtomically(path, EncodePng8(image));
}
void WritePng16(const std::string& path, const Image& image) {
  WriteFileAtomically(path, EncodePng16(image));
}

}  // namespace regrade
