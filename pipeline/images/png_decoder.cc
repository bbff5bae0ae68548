#include "pipeline/images/png_decoder.h"

#include <png.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// libpng with its callbacks. On an error libpng leaves the methods that call it by longjmp:
// they hold no object with a destructor, and return false.
class PngRows {
 public:
  explicit PngRows(std::string_view bytes) : left_(bytes) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, OnError, OnRemark);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
  }
  ~PngRows() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngRows(const PngRows&) = delete;
  PngRows& operator=(const PngRows&) = delete;

  // Everything becomes 8 or 16 bits of grey or RGB, with alpha where there is some.
  bool ReadHeader() {
    if (info_ == nullptr || setjmp(png_jmpbuf(png_))) return false;
    png_set_read_fn(png_, this, OnRead);
    // By default only some chunks' checksums are compared.
    png_set_crc_action(png_, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
    png_read_info(png_, info_);
    png_set_expand(png_);
    if constexpr (std::endian::native == std::endian::little) png_set_swap(png_);
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    return true;
  }

  // The views point into memory of libpng.
  bool ReadColours(bool* linear, std::string_view* exif, std::string_view* icc) {
    if (setjmp(png_jmpbuf(png_))) return false;
    int intent = 0;
    double gamma = 0;
    // Marked as sRGB, or any gamma but 1: encoded.
    if (!png_get_sRGB(png_, info_, &intent) && png_get_gAMA(png_, info_, &gamma))
      *linear = std::abs(gamma - 1) < 0.005;
    png_bytep block = nullptr;
    png_uint_32 size = 0;
    if (png_get_eXIf_1(png_, info_, &size, &block))
      *exif = {reinterpret_cast<const char*>(block), size};
    png_charp name = nullptr;
    int compression = 0;
    if (png_get_iCCP(png_, info_, &name, &compression, &block, &size))
      *icc = {reinterpret_cast<const char*>(block), size};
    return true;
  }

  bool ReadRows(png_bytep* rows) {
    if (setjmp(png_jmpbuf(png_))) return false;
    png_read_image(png_, rows);
    png_read_end(png_, nullptr);  // the last chunks may be damaged or missing
    return true;
  }

  int64_t width() const { return png_get_image_width(png_, info_); }
  int64_t height() const { return png_get_image_height(png_, info_); }
  int channels() const { return png_get_channels(png_, info_); }
  int bits() const { return png_get_bit_depth(png_, info_); }
  int64_t row_bytes() const { return static_cast<int64_t>(png_get_rowbytes(png_, info_)); }
  const char* failure() const { return failure_; }
  int64_t remarks() const { return remarks_; }
  const char* first_remark() const { return first_remark_; }

 private:
  static PngRows& Of(png_structp png) { return *static_cast<PngRows*>(png_get_error_ptr(png)); }
  [[noreturn]] static void OnError(png_structp png, png_const_charp text) {
    std::snprintf(Of(png).failure_, sizeof failure_, "%s", text);
    png_longjmp(png, 1);
  }
  static void OnRemark(png_structp png, png_const_charp text) {
    PngRows& decoder = Of(png);
    if (decoder.remarks_++ == 0)
      std::snprintf(decoder.first_remark_, sizeof first_remark_, "%s", text);
  }
  static void OnRead(png_structp png, png_bytep to, size_t size) {
    PngRows& decoder = *static_cast<PngRows*>(png_get_io_ptr(png));
    if (size > decoder.left_.size()) png_error(png, "truncated: the file ends too early");
    std::memcpy(to, decoder.left_.data(), size);
    decoder.left_.remove_prefix(size);
  }

  std::string_view left_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  char failure_[128] = "out of memory";
  char first_remark_[128] = "";
  int64_t remarks_ = 0;
};

// Values become exact quotients value / max; grey with alpha becomes RGB with alpha.
template <typename Value>
void TakePixels(const std::vector<unsigned char>& bytes, int channels, float max,
                Image* image) {
  for (int64_t i = 0; i < image->num_pixels(); ++i) {
    Value from[4];
    std::memcpy(from, &bytes[static_cast<size_t>(i) * channels * sizeof(Value)],
                static_cast<size_t>(channels) * sizeof(Value));
    float* to = &image->pixels[i * image->channels];
    for (int c = 0; c < std::min(image->channels, 3); ++c)
      to[c] = static_cast<float>(from[channels < 3 ? 0 : c]) / max;
    if (image->channels == 4) to[3] = static_cast<float>(from[channels - 1]) / max;
  }
}

// The body of the first chunk of that name; empty if there is none. A chunk is the size of its
// body, big-endian, the name, the body and a checksum.
std::string_view ChunkOf(std::string_view bytes, std::string_view name) {
  constexpr size_t kSignature = 8, kAround = 12;
  for (size_t at = kSignature; at + kAround <= bytes.size();) {
    size_t size = 0;
    for (size_t i = 0; i < 4; ++i) size = size << 8 | static_cast<unsigned char>(bytes[at + i]);
    if (bytes.substr(at + 4, 4) == name) return bytes.substr(at + 8, size);
    at += kAround + size;
  }
  return {};
}

}  // namespace

PngPicture DecodePng(std::string_view bytes, const std::string& where,
                     const PictureSizeCheck& check) {
  PngRows png(bytes);
  const auto refuse = [&] {
    throw InputError(std::string("cannot read this PNG: ") + png.failure(), where,
                     "copy the file again from its source");
  };
  PngPicture picture;
  std::string_view exif, icc;
  if (!png.ReadHeader() || !png.ReadColours(&picture.linear_light, &exif, &icc)) refuse();
  // libpng passes over EXIF that follows the pixels.
  picture.exif = exif.empty() ? ChunkOf(bytes, "eXIf") : exif;
  picture.icc = icc;
  // libpng 1.6.39 does not know code points, which come before all other marks of colours.
  if (const std::string_view cicp = ChunkOf(bytes, "cICP"); cicp.size() == 4) {
    picture.primaries = static_cast<unsigned char>(cicp[0]);
    picture.transfer = static_cast<unsigned char>(cicp[1]);
    picture.icc.clear();
    picture.linear_light = false;
  }
  picture.bits = png.bits();
  const int channels = png.channels();
  check(png.width(), png.height(), channels * picture.bits / 8);

  std::vector<unsigned char> pixels(png.row_bytes() * png.height());
  std::vector<png_bytep> rows;
  for (int64_t y = 0; y < png.height(); ++y) rows.push_back(&pixels[y * png.row_bytes()]);
  if (!png.ReadRows(rows.data())) refuse();
  picture.image = Image(static_cast<int>(png.width()), static_cast<int>(png.height()),
                        channels == 1   ? 1
                        : channels == 3 ? 3
                                        : 4);
  if (picture.bits == 16)
    TakePixels<uint16_t>(pixels, channels, 65535.f, &picture.image);
  else
    TakePixels<uint8_t>(pixels, channels, 255.f, &picture.image);
  picture.remarks = png.remarks();
  picture.first_remark = png.first_remark();
  return picture;
}

}  // namespace regrade
