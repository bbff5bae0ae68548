#include "pipeline/images/picture_encoder.h"

// jpeglib.h needs FILE and size_t to be declared before it.
#include <csetjmp>
#include <cstdio>
#include <cstdlib>
//
#include <jpeglib.h>
#include <png.h>

#include <bit>
#include <cstdint>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// An EXIF block whose one entry is the colour space: 1, sRGB (EXIF 2.3, 4.6.5).
constexpr unsigned char kSrgbExif[] = {
    'E', 'x', 'i',  'f',  0, 0,                           //
    'M', 'M', 0,    42,   0, 0, 0, 8,                     // big-endian TIFF, directory at 8
    0,   1,   0x87, 0x69, 0, 4, 0, 0, 0, 1, 0, 0, 0, 26,  // its entry: EXIF's directory at 26
    0,   0,   0,    0,                                    // no other directory
    0,   1,   0xA0, 0x01, 0, 3, 0, 0, 0, 1, 0, 1, 0, 0,   // ColorSpace, a short
    0,   0,   0,    0};

// libpng leaves Write by longjmp on an error: it holds no object with a destructor.
class PngWriter {
 public:
  PngWriter() {
    png_ = png_create_write_struct(PNG_LIBPNG_VER_STRING, this, OnError, OnWarning);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
  }
  ~PngWriter() { png_destroy_write_struct(&png_, &info_); }
  PngWriter(const PngWriter&) = delete;
  PngWriter& operator=(const PngWriter&) = delete;

  bool Write(const Image& image, int bits, int level, bool tagged, const png_byte* values) {
    if (info_ == nullptr || setjmp(png_jmpbuf(png_))) return false;
    png_set_write_fn(png_, this, OnBytes, OnFlush);
    png_set_compression_level(png_, level);
    const int kind = image.channels == 1   ? PNG_COLOR_TYPE_GRAY
                     : image.channels == 3 ? PNG_COLOR_TYPE_RGB
                                           : PNG_COLOR_TYPE_RGB_ALPHA;
    png_set_IHDR(png_, info_, static_cast<png_uint_32>(image.width),
                 static_cast<png_uint_32>(image.height), bits, kind, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    if (tagged) png_set_sRGB(png_, info_, PNG_sRGB_INTENT_PERCEPTUAL);
    png_write_info(png_, info_);
    if (bits == 16 && std::endian::native == std::endian::little) png_set_swap(png_);
    const size_t row = size_t{1} * image.width * image.channels * bits / 8;
    for (int y = 0; y < image.height; ++y) png_write_row(png_, values + row * y);
    png_write_end(png_, nullptr);
    return true;
  }
  std::string TakeBytes() { return std::move(bytes_); }
  const char* failure() const { return failure_; }

 private:
  [[noreturn]] static void OnError(png_structp png, png_const_charp text) {
    auto& writer = *static_cast<PngWriter*>(png_get_error_ptr(png));
    std::snprintf(writer.failure_, sizeof failure_, "%s", text);
    png_longjmp(png, 1);
  }
  static void OnWarning(png_structp, png_const_charp) {}
  static void OnBytes(png_structp png, png_bytep from, size_t size) {
    auto& writer = *static_cast<PngWriter*>(png_get_io_ptr(png));
    writer.bytes_.append(reinterpret_cast<const char*>(from), size);
  }
  static void OnFlush(png_structp) {}

  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::string bytes_;
  char failure_[128] = "out of memory";
};

// The same of libjpeg. `base` comes first: libjpeg passes pointers to it.
struct JpegFailure {
  jpeg_error_mgr base;
  jmp_buf jump;
  char message[JMSG_LENGTH_MAX];
};

class JpegWriter {
 public:
  JpegWriter() {
    info_.err = jpeg_std_error(&failure_.base);
    failure_.base.error_exit = OnError;
  }
  ~JpegWriter() {
    jpeg_destroy_compress(&info_);
    std::free(bytes_);
  }
  JpegWriter(const JpegWriter&) = delete;
  JpegWriter& operator=(const JpegWriter&) = delete;

  bool Write(const Image& image, int quality, bool tagged, JSAMPLE* values) {
    if (setjmp(failure_.jump)) return false;
    jpeg_create_compress(&info_);
    jpeg_mem_dest(&info_, &bytes_, &size_);
    info_.image_width = static_cast<JDIMENSION>(image.width);
    info_.image_height = static_cast<JDIMENSION>(image.height);
    info_.input_components = image.channels;
    info_.in_color_space = image.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_set_defaults(&info_);
    jpeg_set_quality(&info_, quality, TRUE);
    jpeg_start_compress(&info_, TRUE);
    if (tagged) jpeg_write_marker(&info_, JPEG_APP0 + 1, kSrgbExif, sizeof kSrgbExif);
    while (info_.next_scanline < info_.image_height) {
      JSAMPROW row = values + size_t{info_.next_scanline} * image.width * image.channels;
      jpeg_write_scanlines(&info_, &row, 1);
    }
    jpeg_finish_compress(&info_);
    return true;
  }
  std::string Bytes() const { return {reinterpret_cast<const char*>(bytes_), size_}; }
  const char* failure() const { return failure_.message; }

 private:
  [[noreturn]] static void OnError(j_common_ptr info) {
    auto& failure = *reinterpret_cast<JpegFailure*>(info->err);
    info->err->format_message(info, failure.message);
    longjmp(failure.jump, 1);
  }

  jpeg_compress_struct info_{};
  JpegFailure failure_{};
  unsigned char* bytes_ = nullptr;
  unsigned long size_ = 0;
};

}  // namespace

std::string EncodePng(const Image& image, int bits, int level, bool tagged) {
  REGRADE_CHECK(image.channels == 1 || image.channels == 3 || image.channels == 4);
  REGRADE_CHECK(bits == 8 || bits == 16);
  std::vector<uint8_t> narrow;
  std::vector<uint16_t> wide;
  if (bits == 8)
    narrow = Quantized<uint8_t>(image);
  else
    wide = Quantized<uint16_t>(image);
  PngWriter writer;
  if (!writer.Write(image, bits, level, tagged,
                    bits == 8 ? narrow.data() : reinterpret_cast<const png_byte*>(wide.data())))
    throw ResourceError(std::string("cannot encode a PNG: ") + writer.failure());
  return writer.TakeBytes();
}

std::string EncodeJpeg(const Image& image, int quality, bool tagged) {
  REGRADE_CHECK(image.channels == 1 || image.channels == 3);
  std::vector<uint8_t> values = Quantized<uint8_t>(image);
  JpegWriter writer;
  if (!writer.Write(image, quality, tagged, values.data()))
    throw ResourceError(std::string("cannot encode a JPEG: ") + writer.failure());
  return writer.Bytes();
}

}  // namespace regrade
