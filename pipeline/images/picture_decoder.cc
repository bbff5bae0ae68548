#include "pipeline/images/picture_decoder.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <OpenImageIO/tiffutils.h>
#include <omp.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/color_profile.h"
#include "pipeline/images/heif_decoder.h"
#include "pipeline/images/image_format.h"
#include "pipeline/images/jpeg_decoder.h"
#include "pipeline/images/png_decoder.h"
#include "pipeline/images/webp_header.h"

namespace regrade {
namespace {

// Picture formats guarantee at most about 1000 decoded bytes for each stored one (DEFLATE's
// limit is 1032); a header that claims far more than its file can hold is malicious or corrupt.
constexpr int64_t kMaxExpansion = 2000, kExpansionSlack = 16 << 20;
constexpr char kReadFormats[] =
    "give a JPEG, PNG, TIFF, WebP, HEIC, AVIF, OpenEXR or camera raw file";

void CheckSize(int64_t width, int64_t height, int64_t pixel_bytes, int64_t file_bytes,
               const DecodeLimits& limits, const std::string& where) {
  const std::string size = Concat(width, " x ", height, " pixels");
  if (width <= 0 || height <= 0) throw InputError("no pixels", where);
  if (width > limits.max_pixels / height)
    throw InputError(
        Concat(size, ", more than the limit of ", limits.max_pixels / 1'000'000, " megapixels"),
        where, "scale it down or raise --max-megapixels");
  if (width * height * pixel_bytes > MostPixelsOf(file_bytes))
    throw InputError(
        Concat("the header claims ", size, ", but the file has only ", file_bytes, " bytes"),
        where);
  if (std::min(width, height) < limits.min_side)
    throw InputError(Concat(size, ", less than ", limits.min_side, " on a side"), where);
}

void CheckRegularFile(const std::string& path) {
  struct stat status;
  if (::stat(path.c_str(), &status) != 0)
    throw InputError(std::strerror(errno), path, "check the name, and its permissions");
  const char* kind = S_ISREG(status.st_mode)    ? nullptr
                     : S_ISDIR(status.st_mode)  ? "a folder"
                     : S_ISFIFO(status.st_mode) ? "a named pipe"
                     : S_ISSOCK(status.st_mode) ? "a socket"
                                                : "a device";
  if (kind) throw InputError(std::string(kind) + ", not a picture file", path);
}

// Seconds times sensitivity over the square of the f-number, which is 1 where it is not given.
double LightOf(const OIIO::ImageSpec& spec) {
  const auto number = [&spec](std::initializer_list<const char*> names) {
    for (const char* name : names)
      if (const float value = spec.get_float_attribute(name); value > 0) return value;
    return 1.0f;
  };
  const float seconds = spec.get_float_attribute("ExposureTime");
  const float sensitivity =
      number({"Exif:PhotographicSensitivity", "Exif:ISOSpeedRatings", "Exif:ISOSpeed"});
  const float stop = number({"FNumber"});
  return seconds > 0 ? double{seconds} * sensitivity / (double{stop} * stop) : 0;
}

// Metadata under OpenImageIO's names.
void TakeMetadata(const OIIO::ImageSpec& spec, StoredPicture* picture) {
  const int orientation = spec.get_int_attribute("Orientation", 1);
  picture->orientation = orientation >= 1 && orientation <= 8 ? orientation : 1;
  picture->taken = spec.get_string_attribute("Exif:DateTimeOriginal");
  const std::string fraction = spec.get_string_attribute("Exif:SubsecTimeOriginal");
  if (!picture->taken.empty() && !fraction.empty()) picture->taken += "." + fraction;
  picture->light = LightOf(spec);
  picture->focal_mm = spec.get_float_attribute("Exif:FocalLength");
  picture->focal_35mm = spec.get_float_attribute("Exif:FocalLengthIn35mmFilm");
  picture->exif_width = spec.get_float_attribute("Exif:PixelXDimension");
  // EXIF units: 2 inch (also the default), 3 cm, 4 mm, 5 um.
  const int unit = spec.get_int_attribute("Exif:FocalPlaneResolutionUnit", 2);
  const double unit_mm = unit == 3 ? 10 : unit == 4 ? 1 : unit == 5 ? 0.001 : 25.4;
  picture->focal_plane_px_per_mm =
      spec.get_float_attribute("Exif:FocalPlaneXResolution") / unit_mm;
}

// Cameras set to Adobe RGB embed no profile: their EXIF block has the entry "R03" of the
// interoperability index (DCF 2.0), which OpenImageIO passes over.
bool MarksAdobeRgb(std::string_view exif) {
  using namespace std::string_view_literals;
  return exif.find("\1\0\2\0\4\0\0\0R03\0"sv) != exif.npos ||
         exif.find("\0\1\0\2\0\0\0\4R03\0"sv) != exif.npos;
}

StoredPicture ReadJpeg(std::string_view bytes, const std::string& where,
                       const DecodeLimits& limits) {
  JpegPicture jpeg = DecodeJpeg(bytes, where, [&](int64_t w, int64_t h, int64_t pixel_bytes) {
    CheckSize(w, h, pixel_bytes, std::ssize(bytes), limits, where);
  });
  StoredPicture picture;
  picture.image = std::move(jpeg.image);
  if (jpeg.damage_warnings > 0) {
    const std::string what = Concat("damaged JPEG (", jpeg.damage_warnings,
                                    " warnings, first: ", jpeg.first_warning, ")");
    if (!limits.accept_damaged)
      throw InputError(what, where,
                       "copy the file again from the camera, or keep it with --accept-damaged");
    picture.notices.push_back(what);
  }
  OIIO::ImageSpec spec;
  if (!jpeg.exif.empty()) OIIO::decode_exif(OIIO::string_view(jpeg.exif), spec);
  TakeMetadata(spec, &picture);
  if (jpeg.from_cmyk)
    picture.notices.push_back(
        "CMYK was converted without its profile: colours are approximate");
  else
    picture.icc = jpeg.icc.empty() && MarksAdobeRgb(jpeg.exif) ? AdobeRgbProfile() : jpeg.icc;
  return picture;
}

StoredPicture ReadPng(std::string_view bytes, const std::string& where,
                      const DecodeLimits& limits) {
  PngPicture png = DecodePng(bytes, where, [&](int64_t w, int64_t h, int64_t pixel_bytes) {
    CheckSize(w, h, pixel_bytes, std::ssize(bytes), limits, where);
  });
  StoredPicture picture;
  picture.image = std::move(png.image);
  picture.bits = png.bits;
  picture.linear_light = png.linear_light;
  OIIO::ImageSpec spec;
  if (!png.exif.empty()) OIIO::decode_exif(OIIO::string_view(png.exif), spec);
  TakeMetadata(spec, &picture);
  picture.icc = png.icc;
  picture.primaries = png.primaries;
  picture.transfer = png.transfer;
  if (png.remarks > 0)
    picture.notices.push_back(Concat("an odd PNG (", png.remarks,
                                     (png.remarks == 1 ? " remark: " : " remarks, first: "),
                                     png.first_remark, ")"));
  return picture;
}

StoredPicture ReadHeif(std::string_view bytes, const std::string& where,
                       const DecodeLimits& limits) {
  HeifPicture heif = DecodeHeif(bytes, where, [&](int64_t w, int64_t h, int64_t pixel_bytes) {
    CheckSize(w, h, pixel_bytes, std::ssize(bytes), limits, where);
  });
  StoredPicture picture;
  picture.image = std::move(heif.image);
  picture.bits = heif.bits;
  picture.premultiplied = heif.premultiplied;
  picture.icc = std::move(heif.icc);
  picture.primaries = heif.primaries;
  picture.transfer = heif.transfer;
  OIIO::ImageSpec spec;
  if (!heif.exif.empty()) OIIO::decode_exif(OIIO::string_view(heif.exif), spec);
  TakeMetadata(spec, &picture);
  picture.orientation = 1;  // libheif has turned the picture; EXIF repeats the turn
  if (heif.pictures > 1) picture.notices.push_back("only the first picture of several is used");
  return picture;
}

int64_t Little16(std::string_view bytes, size_t at) {
  return static_cast<unsigned char>(bytes[at]) | static_cast<unsigned char>(bytes[at + 1]) << 8;
}

// OpenImageIO's decoders for these allocate the picture when they open the file.
void CheckSizeBeforeOpening(std::string_view decoder, std::string_view bytes,
                            const DecodeLimits& limits, const std::string& where) {
  if (decoder == "gif" && bytes.size() >= 10)
    CheckSize(Little16(bytes, 6), Little16(bytes, 8), 1, std::ssize(bytes), limits, where);
  if (decoder != "webp") return;
  const WebpHeader header = ReadWebpHeader(bytes);
  if (header.width > 0 && header.height > 0)
    CheckSize(header.width, header.height, 3, std::ssize(bytes), limits, where);
}

// OpenImageIO passes over the metadata of WebP.
void TakeWebpMetadata(std::string_view bytes, StoredPicture* picture) {
  const WebpHeader header = ReadWebpHeader(bytes);
  OIIO::ImageSpec spec;
  if (!header.exif.empty())
    OIIO::decode_exif(OIIO::string_view(header.exif.data(), header.exif.size()), spec);
  TakeMetadata(spec, picture);
  picture->icc = header.icc;
}

// Reads grey, RGB, or RGB + alpha of the file's channels, as exact quotients value / max: every
// decoder gives the same float for the same integer.
template <typename Value>
bool ReadChannels(OIIO::ImageInput* input, const OIIO::ImageSpec& spec, float max,
                  Image* image) {
  const int stored = spec.nchannels;
  const bool has_alpha = spec.alpha_channel >= 0 && spec.alpha_channel < stored && stored > 1;
  const bool grey = stored - (has_alpha ? 1 : 0) < 3;
  std::vector<Value> values(static_cast<size_t>(spec.width) * spec.height * stored);
  if (!input->read_image(0, 0, 0, stored, OIIO::BaseTypeFromC<Value>::value, values.data()))
    return false;
  *image = Image(spec.width, spec.height, has_alpha ? 4 : grey ? 1 : 3);
  for (int64_t i = 0; i < image->num_pixels(); ++i) {
    const Value* from = &values[static_cast<size_t>(i) * stored];
    float* to = &image->pixels[i * image->channels];
    for (int c = 0; c < std::min(image->channels, 3); ++c)
      to[c] = static_cast<float>(from[grey ? 0 : c]) / max;
    if (has_alpha) to[3] = static_cast<float>(from[spec.alpha_channel]) / max;
  }
  return true;
}

StoredPicture ReadWithOiio(const ImageFormat& format, std::string_view bytes,
                           const std::string& path, const DecodeLimits& limits) {
  const auto refuse = [&](const std::string& why) {
    throw InputError(std::string("cannot read this ") + format.name + ": " + why, path,
                     format.remedy);
  };
  std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create(format.decoder);
  if (input == nullptr) {
    OIIO::geterror();
    refuse("this build has no decoder for it");
  }
  OIIO::ImageSpec spec, config;
  config["oiio:UnassociatedAlpha"] = 1;
  // Camera raw: the same development for every photo.
  config["raw:ColorSpace"] = "sRGB";
  config["raw:use_camera_wb"] = 1;
  config["raw:auto_bright"] = 0;
  config["raw:adjust_maximum_thr"] = 0.f;
  OIIO::Filesystem::IOMemReader memory(bytes.data(), bytes.size());
  if (format.from_memory) input->set_ioproxy(&memory);
  if (!input->open(path, spec, config)) refuse(input->geterror());
  CheckSize(spec.width, spec.height, static_cast<int64_t>(spec.pixel_bytes(true)),
            std::ssize(bytes), limits, path);
  if (spec.deep || spec.depth > 1) refuse("it is not a flat picture");

  StoredPicture picture;
  bool whole = false;
  if (spec.format == OIIO::TypeDesc::UINT8) {
    whole = ReadChannels<uint8_t>(input.get(), spec, 255.f, &picture.image);
  } else if (spec.format == OIIO::TypeDesc::UINT16) {
    picture.bits = 16;
    whole = ReadChannels<uint16_t>(input.get(), spec, 65535.f, &picture.image);
  } else {
    picture.bits = 32;
    whole = ReadChannels<float>(input.get(), spec, 1.f, &picture.image);
  }
  if (!whole) refuse(input->geterror());
  TakeMetadata(spec, &picture);
  const OIIO::string_view space = spec.get_string_attribute("oiio:ColorSpace");
  picture.linear_light = OIIO::Strutil::iequals(space, "linear");
  picture.premultiplied = spec.get_int_attribute("oiio:UnassociatedAlpha") == 0;
  if (const OIIO::ParamValue* profile = spec.find_attribute("ICCProfile"))
    picture.icc.assign(static_cast<const char*>(profile->data()),
                       static_cast<size_t>(profile->datasize()));
  std::array<float, 8> chromaticities;
  if (spec.getattribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8),
                        chromaticities.data()))
    picture.chromaticities = chromaticities;
  if (input->seek_subimage(1, 0))
    picture.notices.push_back("only the first picture of several is used");
  return picture;
}

}  // namespace

StoredPicture DecodePicture(const std::string& path, const DecodeLimits& limits) {
  CheckRegularFile(path);
  // An uncompressed file has at most sixteen bytes a pixel.
  const std::string bytes =
      ReadWholeFile(path, static_cast<uint64_t>(limits.max_pixels) * 16 + (64 << 20));
  if (bytes.empty()) throw InputError("empty file", path);
  const ImageFormat* format = SniffImageFormat(bytes, path);
  if (format == nullptr) throw InputError("not an image", path, kReadFormats);
  const std::string_view decoder = format->decoder;
  if (decoder.empty())
    throw InputError(std::string(format->name) + " is not supported here", path,
                     format->remedy);
  CheckSizeBeforeOpening(decoder, bytes, limits, path);
  StoredPicture picture = decoder == "jpeg"   ? ReadJpeg(bytes, path, limits)
                          : decoder == "png"  ? ReadPng(bytes, path, limits)
                          : decoder == "heif" ? ReadHeif(bytes, path, limits)
                                              : ReadWithOiio(*format, bytes, path, limits);
  if (decoder == "webp") TakeWebpMetadata(bytes, &picture);
  ApplyPhotoRules(&picture, path);
  return picture;
}

int64_t MostPixelsOf(int64_t file_bytes) {
  return kExpansionSlack + kMaxExpansion * file_bytes;
}

void LimitDecodingThreads(int threads) {
  OIIO::attribute("threads", threads);
  omp_set_num_threads(threads);
}

}  // namespace regrade
