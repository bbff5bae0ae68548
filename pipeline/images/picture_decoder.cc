#include "pipeline/images/picture_decoder.h"

#include <omp.h>
#include <sys/stat.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <utility>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/color_profile.h"
#include "pipeline/images/heif_decoder.h"
#include "pipeline/images/image_format.h"
#include "pipeline/images/jpeg_decoder.h"
#include "pipeline/images/oiio_module.h"
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
        where, "scale it down or raise max-megapixels by --config");
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

// 0 until it is set: as many as OpenImageIO takes.
std::atomic<int> threads_of_oiio = 0;

const OiioModule& LimitedOiio() {
  const OiioModule& oiio = Oiio();
  if (const int threads = threads_of_oiio; threads > 0) oiio.LimitThreads(threads);
  return oiio;
}

void TakeExif(std::string_view exif, StoredPicture* picture) {
  if (!exif.empty()) LimitedOiio().TakeExif(exif, picture);
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
                       "copy the file again from the camera, or keep it with --config "
                       "'{\"accept-damaged\":true}'");
    picture.notices.push_back(what);
  }
  TakeExif(jpeg.exif, &picture);
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
  TakeExif(png.exif, &picture);
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
  TakeExif(heif.exif, &picture);
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
  TakeExif(header.exif, picture);
  picture->icc = header.icc;
}

StoredPicture ReadOther(const ImageFormat& format, std::string_view bytes,
                        const std::string& path, const DecodeLimits& limits) {
  return LimitedOiio().Read(format, bytes, path,
                            [&](int64_t w, int64_t h, int64_t pixel_bytes) {
                              CheckSize(w, h, pixel_bytes, std::ssize(bytes), limits, path);
                            });
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
                                              : ReadOther(*format, bytes, path, limits);
  if (decoder == "webp") TakeWebpMetadata(bytes, &picture);
  ApplyPhotoRules(&picture, path);
  return picture;
}

int64_t MostPixelsOf(int64_t file_bytes) {
  return kExpansionSlack + kMaxExpansion * file_bytes;
}

void LimitDecodingThreads(int threads) {
  threads_of_oiio = threads;
  omp_set_num_threads(threads);
}

}  // namespace regrade
