// Damaged and malicious picture files: each is refused with a reason, none crashes or blocks.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "pipeline/images/image_file.h"
#include "tests/pipeline/libjpeg_file.h"
#include "tests/pipeline/picture_corpus.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

using testing::Contains;
using testing::ExifBlock;
using testing::FloatTiff;
using testing::LibjpegFile;
using testing::Photo;
using testing::ReadText;
using testing::Refusal;
using testing::WithSegment;

class DamagedImage : public testing::PictureTest {};

TEST_F(DamagedImage, F1_EmptyFile) { EXPECT_EQ(Refusal(Put("a.jpg", "")), "empty file"); }

TEST_F(DamagedImage, F2_JpegCutAnywhereIsDamaged) {
  const std::string whole = EncodeJpeg(Photo(160, 120, 3), 90);
  ASSERT_EQ(Refusal(Put("whole.jpg", whole)), "");
  for (int percent = 1; percent < 100; ++percent) {
    const std::string path = Put("cut.jpg", whole.substr(0, whole.size() * percent / 100));
    EXPECT_TRUE(Contains(Refusal(path), percent < 2 ? "" : "damaged JPEG")) << percent;
    EXPECT_NE(Refusal(path), "") << percent;
  }
  // Only the end marker is missing: libjpeg inserts one and warns.
  EXPECT_NE(Refusal(Put("end.jpg", whole.substr(0, whole.size() - 2))), "");
}

TEST_F(DamagedImage, F2_AcceptDamagedKeepsItWithANotice) {
  const std::string whole = EncodeJpeg(Photo(160, 120, 3), 90);
  const std::string path = Put("cut.jpg", whole.substr(0, whole.size() / 2));
  const DecodedPhoto photo = DecodePhoto(path, {.accept_damaged = true});
  EXPECT_EQ(photo.image.width, 160);
  EXPECT_TRUE(Contains(photo.notice, "damaged JPEG")) << photo.notice;
}

TEST_F(DamagedImage, F3_FlippedBytesNeverCrash) {
  const std::string jpeg =
      WithSegment(EncodeJpeg(Photo(80, 64, 3), 70), 0xe1, ExifBlock(6, 28));
  WritePng8(scratch_ / "a.png", Photo(64, 64, 4));
  const std::string png = ReadText(scratch_ / "a.png"), tiff = FloatTiff(Photo(64, 64, 4));
  int refused = 0, mutants = 0;
  for (const std::string& original : {jpeg, png, tiff})
    for (int i = 0; i < 400; ++i, ++mutants) {
      std::string mutant = original;
      // Half of the changes are in the headers.
      const uint64_t range = i % 2 ? mutant.size() : std::min<uint64_t>(mutant.size(), 300);
      for (int k = 0; k < 1 + i % 4; ++k)
        mutant[RandomIndex(1, i, k, range)] = static_cast<char>(RandomBits(2, i, k));
      if (!Refusal(Put("mutant", mutant), {.min_side = 1}).empty()) ++refused;
    }
  EXPECT_GT(refused, mutants / 4);
}

TEST_F(DamagedImage, F4_PngDamageIsNamed) {
  WritePng8(scratch_ / "a.png", Photo(80, 70, 3));
  const std::string whole = ReadText(scratch_ / "a.png");
  std::string flipped = whole;
  flipped[whole.size() / 2] ^= 1;
  EXPECT_TRUE(Contains(Refusal(Put("b.png", flipped)), "cannot read this PNG: "));
  for (size_t cut = 9; cut < whole.size(); cut += 97)
    EXPECT_TRUE(Contains(Refusal(Put("c.png", whole.substr(0, cut))), "truncated")) << cut;
  EXPECT_TRUE(Contains(Refusal(Put("d.png", whole.substr(0, whole.size() - 1))), "truncated"));
  EXPECT_EQ(Refusal(Put("e.png", whole + "more")), "");
}

TEST_F(DamagedImage, F5_ContentDecidesNotTheName) {
  EXPECT_EQ(Refusal(Put("a.jpg", "Dear diary, ")), "not an image");
  EXPECT_EQ(Refusal(Put("notes.txt", EncodePng8(Photo(64, 64, 1)))), "");
  EXPECT_EQ(Refusal(Put("png.jpg", EncodePng8(Photo(64, 64, 1)))), "");
  EXPECT_EQ(Refusal(Put("jpg", EncodeJpeg(Photo(64, 64, 1), 80))), "");
}

// A PNG whose header claims a size, with correct checksums and hardly any data.
std::string BombPng(uint32_t width, uint32_t height) {
  std::string png = EncodePng8(Image(64, 64, 3));
  const auto put = [&](size_t at, uint32_t value) {
    for (int i = 0; i < 4; ++i) png[at + i] = static_cast<char>(value >> (24 - 8 * i));
  };
  put(16, width);
  put(20, height);
  uint32_t crc = ~0u;
  for (size_t i = 12; i < 29; ++i) {
    crc ^= static_cast<unsigned char>(png[i]);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (crc & 1 ? 0xedb88320u : 0);
  }
  put(29, ~crc);
  return png;
}

TEST_F(DamagedImage, F6_BombsAreRefusedFromTheHeader) {
  EXPECT_TRUE(Contains(Refusal(Put("a.png", BombPng(100000, 100000))), "more than the limit"));
  EXPECT_NE(Refusal(Put("b.png", BombPng(0x7fffffff, 0x7fffffff))), "");
  EXPECT_TRUE(Contains(Refusal(Put("c.png", BombPng(10000, 10000))), "the header claims"));
  EXPECT_TRUE(
      Contains(Refusal(Put("d.png", BombPng(200, 200)), {.max_pixels = 39'999}), "limit"));
  std::string jpeg = EncodeJpeg(Photo(64, 64, 1), 80);
  const size_t frame = jpeg.find("\xff\xc0");
  for (int i = 5; i < 9; i += 2) jpeg[frame + i] = static_cast<char>(0xff);  // 65000 or so
  EXPECT_TRUE(Contains(Refusal(Put("e.jpg", jpeg)), "more than the limit"));
  const std::string gif = "GIF89a\xff\xff\xff\xff" + std::string(100, '\0');
  EXPECT_TRUE(Contains(Refusal(Put("f.gif", gif)), "more than the limit"));
}

TEST_F(DamagedImage, F7_ThousandsOfScansAreRefused) {
  const std::vector<unsigned char> grey(64 * 64, 90);
  EXPECT_EQ(Refusal(Put("a.jpg", LibjpegFile(grey, 64, 64, JCS_GRAYSCALE, 1, 64))), "");
  EXPECT_TRUE(Contains(Refusal(Put("b.jpg", LibjpegFile(grey, 64, 64, JCS_GRAYSCALE, 1, 120))),
                       "scans"));
}

TEST_F(DamagedImage, F8_OnlyRegularFilesAreOpened) {
  ASSERT_EQ(::mkfifo((scratch_ / "pipe.jpg").c_str(), 0600), 0);
  EXPECT_TRUE(Contains(Refusal(scratch_ / "pipe.jpg"), "a named pipe"));
  std::filesystem::create_directory(scratch_ / "folder.jpg");
  EXPECT_TRUE(Contains(Refusal(scratch_ / "folder.jpg"), "a folder"));
  EXPECT_TRUE(Contains(Refusal("/dev/zero"), "a device"));
}

TEST_F(DamagedImage, F10_MissingAndBrokenLinks) {
  EXPECT_TRUE(Contains(Refusal(scratch_ / "none.jpg"), "No such file"));
  std::filesystem::create_symlink("loop.jpg", scratch_ / "loop.jpg");
  EXPECT_TRUE(Contains(Refusal(scratch_ / "loop.jpg"), "symbolic links"));
}

TEST_F(DamagedImage, F16_ABadStylePictureIsReported) {
  const auto refusal = [](const std::string& path) {
    const Error error = testing::ErrorFrom([&] { ReadStylePicture(path, nullptr); });
    EXPECT_EQ(error.code(), ExitCode::kInput);
    return error.what_failed();
  };
  EXPECT_TRUE(Contains(refusal(scratch_ / "none.png"), "No such file"));
  EXPECT_TRUE(Contains(refusal(scratch_.path()), "a folder"));
  const std::string jpeg = EncodeJpeg(Photo(64, 64, 1), 80);
  EXPECT_TRUE(Contains(refusal(Put("cut.jpg", jpeg.substr(0, jpeg.size() / 2))), "damaged"));
  ReadStylePicture(Put("tiny.png", EncodePng8(Photo(3, 1, 1, 1))), nullptr);
}

TEST_F(DamagedImage, F16_TransparentStyleIsLaidOverWhite) {
  Image style(8, 8, 4);  // black, half transparent
  for (int i = 0; i < 64; ++i) style.pixels[4 * i + 3] = 0.2f;
  std::string notice;
  const Image read = ReadStylePicture(Put("s.png", EncodePng8(style)), &notice);
  EXPECT_EQ(read.channels, 3);
  EXPECT_NEAR(read.pixels[0], 0.8f, 1e-6);
  EXPECT_TRUE(Contains(notice, "white"));
}

}  // namespace
}  // namespace regrade
