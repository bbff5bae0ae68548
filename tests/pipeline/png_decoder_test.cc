// Compares our PNG decoder with OpenImageIO's, and checks that libpng's warnings are not
// printed.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>
#include <png.h>

#include <vector>

#include "pipeline/images/image_file.h"
#include "tests/pipeline/picture_corpus.h"

namespace regrade {
namespace {

using testing::Contains;
using testing::Refusal;
using testing::WithChunk;

struct Kind {
  int color, bits;
  bool interlaced = false, transparent = false;
};

// A picture of every kind that the format knows, straight from libpng.
std::string LibpngFile(const Kind& kind, int width, int height) {
  std::string bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  const auto append = [](png_structp writer, png_bytep data, size_t size) {
    static_cast<std::string*>(png_get_io_ptr(writer))
        ->append(reinterpret_cast<char*>(data), size);
  };
  png_set_write_fn(png, &bytes, append, nullptr);
  png_set_IHDR(png, info, width, height, kind.bits, kind.color,
               kind.interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, 0, 0);
  png_color palette[16];
  png_byte clear[] = {0, 40, 255, 128};
  for (int i = 0; i < 16; ++i)
    palette[i] = {static_cast<png_byte>(16 * i), static_cast<png_byte>(250 - 9 * i),
                  static_cast<png_byte>(i * i)};
  if (kind.color == PNG_COLOR_TYPE_PALETTE) png_set_PLTE(png, info, palette, 16);
  png_color_16 key{};
  key.gray = key.red = key.green = key.blue = 1;
  if (kind.transparent && kind.color == PNG_COLOR_TYPE_PALETTE)
    png_set_tRNS(png, info, clear, 4, nullptr);
  else if (kind.transparent)
    png_set_tRNS(png, info, nullptr, 0, &key);
  png_write_info(png, info);
  const size_t row = png_get_rowbytes(png, info);
  std::vector<png_byte> pixels(row * static_cast<size_t>(height));
  for (size_t i = 0; i < pixels.size(); ++i) {
    pixels[i] = static_cast<png_byte>(RandomBits(7, 0, i));
    if (kind.color == PNG_COLOR_TYPE_PALETTE && kind.bits == 8) pixels[i] %= 16;
  }
  std::vector<png_bytep> rows;
  for (int y = 0; y < height; ++y) rows.push_back(&pixels[row * static_cast<size_t>(y)]);
  png_write_image(png, rows.data());
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  return bytes;
}

// As the library reads it, straight alpha, and grey with alpha as colours.
std::vector<float> ByOpenImageIo(const std::string& bytes, int* channels, int* bits) {
  OIIO::ImageSpec spec, config;
  config["oiio:UnassociatedAlpha"] = 1;
  OIIO::Filesystem::IOMemReader memory(bytes.data(), bytes.size());
  auto input = OIIO::ImageInput::create("png");
  input->set_ioproxy(&memory);
  EXPECT_TRUE(input->open("a.png", spec, config));
  *channels = spec.nchannels;
  *bits = static_cast<int>(spec.format.size()) * 8;
  const size_t size = static_cast<size_t>(spec.width) * spec.height * spec.nchannels;
  std::vector<uint16_t> wide(size);
  std::vector<uint8_t> narrow(size);
  std::vector<float> values(size);
  EXPECT_TRUE(
      *bits == 16
          ? input->read_image(0, 0, 0, *channels, OIIO::TypeDesc::UINT16, wide.data())
          : input->read_image(0, 0, 0, *channels, OIIO::TypeDesc::UINT8, narrow.data()));
  for (size_t i = 0; i < size; ++i)
    values[i] = *bits == 16 ? wide[i] / 65535.f : narrow[i] / 255.f;
  return values;
}

class PngDecoder : public testing::PictureTest {};

TEST_F(PngDecoder, EveryKindIsReadAsOpenImageIoReadsIt) {
  int kinds = 0;
  for (const auto& [color, depths] :
       std::vector<std::pair<int, std::vector<int>>>{{PNG_COLOR_TYPE_GRAY, {1, 2, 4, 8, 16}},
                                                     {PNG_COLOR_TYPE_PALETTE, {4, 8}},
                                                     {PNG_COLOR_TYPE_RGB, {8, 16}},
                                                     {PNG_COLOR_TYPE_GRAY_ALPHA, {8, 16}},
                                                     {PNG_COLOR_TYPE_RGB_ALPHA, {8, 16}}})
    for (const int bits : depths)
      for (const bool interlaced : {false, true})
        for (const bool transparent : {false, true}) {
          if (transparent && color & PNG_COLOR_MASK_ALPHA) continue;
          const std::string bytes = LibpngFile({color, bits, interlaced, transparent}, 71, 65);
          const DecodedPhoto photo = DecodePhoto(Put("a.png", bytes));
          int channels = 0, depth = 0;
          const std::vector<float> expected = ByOpenImageIo(bytes, &channels, &depth);
          const std::string what = std::to_string(color) + " " + std::to_string(bits);
          EXPECT_EQ(photo.bits, depth) << what;
          EXPECT_EQ(photo.notice, "") << what;
          const bool alpha = channels == 2 || channels == 4;
          ASSERT_EQ(photo.image.channels, alpha ? 4 : 3) << what;
          for (int64_t i = 0; i < photo.image.num_pixels(); ++i)
            for (int c = 0; c < photo.image.channels; ++c) {
              const int from = c == 3 ? channels - 1 : channels < 3 ? 0 : c;
              ASSERT_EQ(photo.image.pixels[i * photo.image.channels + c],
                        expected[static_cast<size_t>(i * channels + from)])
                  << what << " at " << i;
            }
          ++kinds;
        }
  EXPECT_EQ(kinds, 44);
}

// Warnings of libpng become notices of the photo and are not printed.
TEST_F(PngDecoder, F4_RemarksAreNoticesAndNothingIsPrinted) {
  const std::string whole = LibpngFile({PNG_COLOR_TYPE_RGB, 8}, 80, 70);
  const std::string profile("iCCPodd\0\0not deflated", 22), gamma("gAMA\0\0\0\0", 8),
      sizes("pHYs\1", 5);
  std::string flipped = WithChunk(whole, gamma);
  flipped[8 + 12 + 13 + 9] ^= 1;
  ::testing::internal::CaptureStderr();
  const DecodedPhoto odd = DecodePhoto(Put("a.png", WithChunk(whole, profile)));
  const DecodedPhoto twice =
      DecodePhoto(Put("b.png", WithChunk(WithChunk(whole, sizes), profile)));
  const std::string damage = Refusal(Put("c.png", flipped));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_TRUE(Contains(odd.notice, "an odd PNG (1 remark: ")) << odd.notice;
  EXPECT_TRUE(Contains(odd.notice, "iCCP")) << odd.notice;
  EXPECT_TRUE(Contains(twice.notice, "remarks, first: ")) << twice.notice;
  EXPECT_TRUE(Contains(damage, "gAMA: CRC error")) << damage;
  EXPECT_EQ(odd.image.pixels, DecodePhoto(Put("e.png", whole)).image.pixels);
}

TEST_F(PngDecoder, F4_LibpngErrorsAreReported) {
  // Pixels cut short inside their deflate stream, every checksum right.
  std::string png = LibpngFile({PNG_COLOR_TYPE_RGB, 8}, 80, 70);
  const size_t data = png.find("IDAT");
  const std::string cut = WithChunk(png.substr(0, 33), png.substr(data, 4 + 100));
  const std::string end("\0\0\0\0IEND\xae\x42\x60\x82", 12);
  ::testing::internal::CaptureStderr();
  const std::string refusal = Refusal(Put("a.png", cut + end));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_TRUE(Contains(refusal, "cannot read this PNG: ")) << refusal;
}

}  // namespace
}  // namespace regrade
