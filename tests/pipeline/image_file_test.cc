#include "pipeline/images/image_file.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>

#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "tests/pipeline/libjpeg_file.h"
#include "tests/pipeline/picture_corpus.h"
#include "tests/support/data.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

using testing::Contains;
using testing::ExifBlock;
using testing::FloatTiff;
using testing::GpsBlock;
using testing::LargestDifference;
using testing::LibjpegFile;
using testing::Photo;
using testing::ReadText;
using testing::Refusal;
using testing::WebpOf;
using testing::WithChunk;
using testing::WithLateChunk;
using testing::WithSegment;

class ImageFile : public testing::PictureTest {};

// --- writing

TEST_F(ImageFile, H152_WriteReadWriteIsAFixedPoint) {
  for (const int channels : {1, 3, 4}) {
    // Arbitrary floats: after one rounding nothing changes.
    Image image = Photo(70, 65, 5, channels);
    for (float& v : image.pixels) v = v * 1.1f - 0.03f;
    WritePng8(scratch_ / "a.png", image);
    const Image once = ReadImage(scratch_ / "a.png");
    EXPECT_LE(LargestDifference(once, Photo(70, 65, 5, channels)), 0.1);
    WritePng8(scratch_ / "b.png", once);
    EXPECT_EQ(ReadText(scratch_ / "a.png"), ReadText(scratch_ / "b.png"));
    EXPECT_EQ(ReadImage(scratch_ / "b.png").pixels, once.pixels);
  }
}

TEST_F(ImageFile, H149_All256ValuesPassExactly) {
  Image image(256, 64, 1);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 256; ++x) *image.at(x, y) = static_cast<float>(x / 255.0);
  WritePng8(scratch_ / "a.png", image);
  const Image read = ReadImage(scratch_ / "a.png");
  for (int x = 0; x < 256; ++x) EXPECT_EQ(*read.at(x, 7), static_cast<float>(x) / 255.f);
}

TEST_F(ImageFile, H152_RoundsHalfUpAndClamps) {
  Image image(64, 64, 1);
  // 128/256 = 127.5/255: exactly between 127 and 128.
  image.pixels = std::vector<float>(64 * 64, 0.5f);
  image.pixels[1] = -3.f;
  image.pixels[2] = 7.f;
  image.pixels[3] = std::numeric_limits<float>::quiet_NaN();
  image.pixels[4] = std::numeric_limits<float>::infinity();
  WritePng8(scratch_ / "a.png", image);
  const Image read = ReadImage(scratch_ / "a.png");
  const int expected[] = {128, 0, 255, 0, 255};
  for (int i = 0; i < 5; ++i) EXPECT_EQ(std::lround(read.pixels[i] * 255.0), expected[i]) << i;
}

TEST_F(ImageFile, StraightAlphaPassesUntouched) {
  Image image = Photo(64, 64, 2, 4);
  for (int i = 0; i < 64 * 64; ++i) image.pixels[4 * i + 3] = (i % 5) / 5.f;
  WritePng8(scratch_ / "a.png", image);
  // Colours survive also where alpha is 0.
  EXPECT_LE(LargestDifference(ReadImage(scratch_ / "a.png"), image), 6e-8);  // half an ulp at 1
}

TEST_F(ImageFile, H142_SixteenBitsAreKept) {
  Image depth(64, 64, 1);
  for (int i = 0; i < 64 * 64; ++i) depth.pixels[i] = static_cast<float>(i * 16 / 65535.0);
  WritePng16(scratch_ / "d.png", depth);
  const DecodedPhoto photo = DecodePhoto(scratch_ / "d.png");
  EXPECT_EQ(photo.bits, 16);
  for (int i = 0; i < 64 * 64; ++i)
    EXPECT_EQ(std::lround(photo.image.pixels[3 * i] * 65535.0), i * 16);
}

TEST_F(ImageFile, F28_FullDiskKeepsTheOldFileAndLeavesNoTemporary) {
  const std::string disk = scratch_ / "disk";
  std::filesystem::create_directory(disk);
  if (::mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=200k") != 0)
    GTEST_SKIP() << "cannot mount a small disk here";
  const Image small = Photo(64, 64, 1), large = Photo(1000, 1000, 2);
  WritePng8(disk + "/a.png", small);
  EXPECT_REGRADE_ERROR(WritePng8(disk + "/a.png", large), ExitCode::kResources,
                       "No space left");
  EXPECT_EQ(ReadImage(disk + "/a.png").width, 64);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(disk), {}), 1);
  ::umount2(disk.c_str(), MNT_DETACH);
}

TEST_F(ImageFile, F31_FileSizeLimitIsAnErrorNotADeath) {
  rlimit old;
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &old), 0);
  const auto old_handler = ::signal(SIGXFSZ, SIG_IGN);
  const rlimit small = {4096, old.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const Error error =
      testing::ErrorFrom([&] { WritePng8(scratch_ / "a.png", Photo(200, 200, 1)); });
  ::setrlimit(RLIMIT_FSIZE, &old);
  ::signal(SIGXFSZ, old_handler);
  EXPECT_EQ(error.code(), ExitCode::kResources);
  EXPECT_TRUE(Contains(error.what_failed(), "File too large")) << error.what();
  EXPECT_TRUE(std::filesystem::is_empty(scratch_.path()));
}

TEST_F(ImageFile, F30_AMissingFolderIsReported) {
  EXPECT_REGRADE_ERROR(WritePng8(scratch_ / "none/a.png", Photo(64, 64, 1)),
                       ExitCode::kResources, "cannot create");
}

TEST_F(ImageFile, JpegLooksLikeThePhoto) {
  Image smooth(64, 64, 3);
  for (int i = 0; i < 64 * 64 * 3; ++i) smooth.pixels[i] = (i / 3 % 64) / 80.f;
  const std::string best = EncodeJpeg(smooth, 95), small = EncodeJpeg(smooth, 20);
  EXPECT_LT(small.size(), best.size());
  // Quality 95 on a ramp: a few steps of 1/255.
  EXPECT_LT(LargestDifference(DecodePhoto(Put("a.jpg", best)).image, smooth), 0.03);
}

// --- kinds of photos

// The lossy chunk of a WebP file.
std::string WebpPixels(const Image& image) {
  const testing::TemporaryFolder folder;
  const std::string path = folder / "a.webp";
  OIIO::ImageSpec spec(image.width, image.height, 3, OIIO::TypeDesc::UINT8);
  const auto output = OIIO::ImageOutput::create("webp");
  EXPECT_TRUE(output->open(path, spec) &&
              output->write_image(OIIO::TypeDesc::FLOAT, image.pixels.data()) &&
              output->close());
  const std::string file = ReadText(path);
  EXPECT_EQ(file.substr(8, 8), "WEBPVP8 ");
  return file.substr(20);
}

TEST_F(ImageFile, H141_EveryExifOrientationComesUpright) {
  // Stored 96 x 64 with a bright top left eighth; its upright position by the EXIF standard.
  Image stored(96, 64, 3);
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 32; ++x)
      for (int c = 0; c < 3; ++c) stored.at(x, y)[c] = 1.f;
  const std::string jpeg = EncodeJpeg(stored, 95), png = EncodePng8(stored);
  const std::string pixels = WebpPixels(stored);
  struct Seen {
    bool turned, right, bottom;
  };
  const Seen expected[] = {{false, false, false}, {false, true, false}, {false, true, true},
                           {false, false, true},  {true, false, false}, {true, true, false},
                           {true, true, true},    {true, false, true}};
  for (int o = 1; o <= 8; ++o) {
    const std::string exif = ExifBlock(o, 0), tiff = exif.substr(6);
    const std::vector<std::pair<std::string, std::string>> files = {
        {"o.jpg", WithSegment(jpeg, 0xe1, exif)},
        {"o.png", WithChunk(png, "eXIf" + tiff)},
        {"late.png", WithLateChunk(png, "eXIf" + tiff)},
        {"o.webp", WebpOf(96, 64, {{"VP8 ", pixels}, {"EXIF", tiff}})},
        {"named.webp", WebpOf(96, 64, {{"VP8 ", pixels}, {"EXIF", exif}})}};
    for (const auto& [name, bytes] : files) {
      const Image seen = DecodePhoto(Put(name, bytes)).image;
      const Seen& e = expected[o - 1];
      EXPECT_EQ(seen.width, e.turned ? 64 : 96) << name << o;
      ASSERT_EQ(seen.height, e.turned ? 96 : 64) << name << o;
      const int x = e.right ? seen.width - 3 : 2, y = e.bottom ? seen.height - 3 : 2;
      EXPECT_GT(*seen.at(x, y), 0.9f) << name << o;
      EXPECT_LT(*seen.at(seen.width - 1 - x, seen.height - 1 - y), 0.1f) << name << o;
      // The longer side of the mark lies along the stored rows.
      EXPECT_GT(*seen.at(e.turned  ? x
                         : e.right ? seen.width - 28
                                   : 27,
                         e.turned ? (e.bottom ? seen.height - 28 : 27) : y),
                0.9f)
          << name << o;
    }
  }
  EXPECT_EQ(DecodePhoto(Put("o.jpg", WithSegment(jpeg, 0xe1, ExifBlock(77, 0)))).image.width,
            96);
}

// A header of a few bytes; the decoder would allocate its canvas before anything else.
TEST_F(ImageFile, AHugeCanvasOfWebpIsRefusedBeforeItIsAllocated) {
  const std::string path = Put("a.webp", WebpOf(65535, 65535, {{"VP8 ", "x"}}));
  EXPECT_TRUE(Contains(Refusal(path), "65535 x 65535 pixels, more than the limit"));
  EXPECT_TRUE(Contains(Refusal(path, {.max_pixels = int64_t{1} << 40}), "the header claims"));
}

TEST_F(ImageFile, FocalLengthFromExif) {
  const std::string jpeg = EncodeJpeg(Photo(360, 240, 1), 80);
  const auto focal = [&](const std::string& exif) {
    return DecodePhoto(Put("f.jpg", WithSegment(jpeg, 0xe1, exif))).exif_focal_px;
  };
  // 3:2 like 35 mm film: 10 pixels a millimetre.
  EXPECT_NEAR(focal(ExifBlock(1, 28)), 280, 1e-6);
  EXPECT_NEAR(focal(ExifBlock(6, 28)), 280, 1e-6);
  // 5 mm lens, 600 pixels a cm on the sensor.
  EXPECT_NEAR(focal(ExifBlock(1, 0, 5, 600)), 300, 1e-4);
  EXPECT_NEAR(focal(ExifBlock(1, 28, 5, 600)), 280, 1e-6) << "35 mm film is preferred";
  EXPECT_EQ(focal(ExifBlock(1, 0)), 0);
  EXPECT_EQ(focal(ExifBlock(1, 60000)), 0) << "nonsense";
  EXPECT_EQ(DecodePhoto(Put("n.jpg", jpeg)).exif_focal_px, 0);
}

TEST_F(ImageFile, PlacesFromExif) {
  const std::string jpeg = EncodeJpeg(Photo(96, 64, 1), 80);
  const auto place = [&](const std::string& exif) {
    return DecodePhoto(Put("g.jpg", WithSegment(jpeg, 0xe1, exif))).gps;
  };
  const auto south = place(GpsBlock('S', {33, 51, 3540}, 'W', {151, 12, 4000}, true, 12));
  ASSERT_TRUE(south.has_value());
  EXPECT_NEAR(south->latitude, -(33 + 51 / 60.0 + 35.4 / 3600), 1e-7);
  EXPECT_NEAR(south->longitude, -(151 + 12 / 60.0 + 40 / 3600.0), 1e-6);
  EXPECT_EQ(south->altitude, -12);
  const auto north = place(GpsBlock('N', {46, 50, 0}, 'E', {7, 0, 0}, false, 198));
  ASSERT_TRUE(north.has_value());
  EXPECT_NEAR(north->latitude, 46 + 50 / 60.0, 1e-6);
  EXPECT_EQ(north->longitude, 7);
  EXPECT_EQ(north->altitude, 198);
  EXPECT_FALSE(place(GpsBlock('N', {0, 0, 0}, 'E', {0, 0, 0}, false, 0))) << "no fix";
  EXPECT_FALSE(place(GpsBlock('N', {91, 0, 0}, 'E', {7, 0, 0}, false, 0)));
  EXPECT_FALSE(place(ExifBlock(1, 28)));
}

TEST_F(ImageFile, PlaceOfADrone) {
  REGRADE_NEED_DATA("drone_beach/DJI_0018.JPG");
  const auto gps = DecodePhoto(testing::DataPath("drone_beach/DJI_0018.JPG")).gps;
  ASSERT_TRUE(gps.has_value());
  EXPECT_NEAR(gps->latitude, 46 + 50 / 60.0 + 33.3855 / 3600, 1e-7);
  EXPECT_NEAR(gps->longitude, -(91 + 59 / 60.0 + 40.4156 / 3600), 1e-6);
  EXPECT_NEAR(gps->altitude, 198.309, 1e-3);
}

TEST_F(ImageFile, H143_NanIsRefusedAndOutOfRangeClamped) {
  Image image = Photo(64, 64, 3);
  EXPECT_EQ(DecodePhoto(Put("a.tif", FloatTiff(image))).image.pixels, image.pixels);
  image.pixels[5] = -0.5f;
  image.pixels[6] = 1.5f;
  const DecodedPhoto clamped = DecodePhoto(Put("b.tif", FloatTiff(image)));
  EXPECT_EQ(clamped.bits, 32);
  EXPECT_EQ(clamped.image.pixels[5], 0.f);
  EXPECT_EQ(clamped.image.pixels[6], 1.f);
  EXPECT_NEAR(clamped.clipped, 2.0 / 12288, 1e-9);
  image.pixels[7] = std::numeric_limits<float>::quiet_NaN();
  image.pixels[9] = std::numeric_limits<float>::infinity();
  EXPECT_TRUE(Contains(Refusal(Put("c.tif", FloatTiff(image))), "2 of 12288 values are NaN"));
}

TEST_F(ImageFile, H143_LinearLightIsEncoded) {
  const std::string path = scratch_ / "a.exr";
  const auto output = OIIO::ImageOutput::create("openexr");
  ASSERT_TRUE(output && output->open(path, OIIO::ImageSpec(64, 64, 3, OIIO::TypeDesc::HALF)));
  const std::vector<float> light(64 * 64 * 3, 0.25f);
  ASSERT_TRUE(output->write_image(OIIO::TypeDesc::FLOAT, light.data()) && output->close());
  // 1.055 * 0.25^(1/2.4) - 0.055
  EXPECT_NEAR(DecodePhoto(path).image.pixels[0], 0.537099, 1e-5);
}

TEST_F(ImageFile, H144_CmykIsConvertedWithANotice) {
  // Adobe stores inks inverted: 255 is no ink. Cyan only: red goes.
  std::vector<unsigned char> inks(64 * 64 * 4, 255);
  for (int i = 0; i < 64 * 64; ++i) inks[4 * i] = 55;
  const DecodedPhoto photo =
      DecodePhoto(Put("a.jpg", LibjpegFile(inks, 64, 64, JCS_CMYK, 4, 0)));
  ASSERT_EQ(photo.image.channels, 3);
  EXPECT_NEAR(photo.image.pixels[0], 55 / 255.0, 0.02);
  EXPECT_NEAR(photo.image.pixels[1], 1.0, 0.02);
  EXPECT_TRUE(Contains(photo.notice, "CMYK"));
}

TEST_F(ImageFile, H145_AColourProfileIsReported) {
  // Marked as a profile, but invalid: reported without a crash.
  std::string body = std::string("ICC_PROFILE\0\1\1", 14) + std::string(200, 'x');
  const std::string jpeg = EncodeJpeg(Photo(64, 64, 1), 80);
  EXPECT_TRUE(Contains(DecodePhoto(Put("a.jpg", WithSegment(jpeg, 0xe2, body))).notice,
                       "colour profile"));
  EXPECT_EQ(DecodePhoto(Put("b.jpg", jpeg)).notice, "");
}

TEST_F(ImageFile, H146_AlphaIsKeptAndNothingVisibleIsAnError) {
  Image image = Photo(64, 64, 3, 4);
  const DecodedPhoto photo = DecodePhoto(Put("a.png", EncodePng8(image)));
  EXPECT_EQ(photo.image.channels, 4);
  for (int i = 0; i < 64 * 64; ++i) image.pixels[4 * i + 3] = 0;
  EXPECT_TRUE(Contains(Refusal(Put("b.png", EncodePng8(image))), "alpha is 0 everywhere"));
}

TEST_F(ImageFile, H147_GreyIsReplicatedForPhotosOnly) {
  const std::string path = Put("g.png", EncodePng8(Photo(64, 64, 3, 1)));
  const Image photo = DecodePhoto(path).image;
  ASSERT_EQ(photo.channels, 3);
  EXPECT_EQ(photo.pixels[0], photo.pixels[2]);
  EXPECT_EQ(ReadImage(path).channels, 1);
  EXPECT_EQ(DecodePhoto(Put("g.jpg", EncodeJpeg(Photo(64, 64, 3, 1), 80))).image.channels, 3);
}

TEST_F(ImageFile, H150_TooSmall) {
  EXPECT_TRUE(Contains(Refusal(Put("a.png", EncodePng8(Photo(63, 200, 1)))), "less than 64"));
}

TEST_F(ImageFile, H151_FirstPageWithANotice) {
  const std::string path = scratch_ / "pages.tif";
  const auto output = OIIO::ImageOutput::create("tiff");
  const OIIO::ImageSpec spec(64, 64, 3, OIIO::TypeDesc::UINT8);
  ASSERT_TRUE(output && output->open(path, spec));
  const Image first = Photo(64, 64, 1), second = Photo(64, 64, 2);
  ASSERT_TRUE(output->write_image(OIIO::TypeDesc::FLOAT, first.pixels.data()));
  ASSERT_TRUE(output->open(path, spec, OIIO::ImageOutput::AppendSubimage));
  ASSERT_TRUE(output->write_image(OIIO::TypeDesc::FLOAT, second.pixels.data()));
  ASSERT_TRUE(output->close());
  const DecodedPhoto photo = DecodePhoto(path);
  EXPECT_TRUE(Contains(photo.notice, "only the first")) << photo.notice;
  EXPECT_LE(LargestDifference(photo.image, first), 6e-8);
}

TEST_F(ImageFile, OtherFormatsAreReadByContent) {
  for (const char* format : {"tiff", "webp", "bmp", "heif"}) {
    const std::string path = scratch_ / std::string("picture.") + format;
    const auto output = OIIO::ImageOutput::create(format);
    const Image image = Photo(128, 96, 1);
    if (!output || !output->open(path, OIIO::ImageSpec(128, 96, 3, OIIO::TypeDesc::UINT8)) ||
        !output->write_image(OIIO::TypeDesc::FLOAT, image.pixels.data()) || !output->close()) {
      std::printf("cannot write %s here; not tested\n", format);
      continue;
    }
    std::filesystem::rename(path, scratch_ / "no_extension");
    EXPECT_EQ(Refusal(scratch_ / "no_extension"), "") << format;
    EXPECT_EQ(DecodePhoto(scratch_ / "no_extension").image.width, 128) << format;
  }
}

TEST_F(ImageFile, AnyWhiteSpaceMayFollowThePpmMark) {
  for (const std::string space : {"\n", " "}) {
    testing::WriteText(scratch_ / "a.ppm", "P6" + space + "2 1 255\nabcdef");
    const Image image = ReadImage(scratch_ / "a.ppm");
    EXPECT_EQ(image.width, 2);
    EXPECT_NEAR(image.at(1, 0)[2], 'f' / 255.0, 1e-6);
  }
}

TEST_F(ImageFile, UnsupportedFormatsAreNamedWithARemedy) {
  const std::string path = Put("clip.jpg", std::string("\0\0\0\x18"
                                                       "ftypisom",
                                                       12) +
                                               "....");
  EXPECT_REGRADE_ERROR(DecodePhoto(path), ExitCode::kInput, ": video is not supported here (",
                       "frames");
  // A raw file has the form of a TIFF with a thumbnail: it is not read as TIFF.
  const std::string refusal = Refusal(Put("a.NEF", FloatTiff(Photo(64, 64, 1))));
  EXPECT_TRUE(Contains(refusal, "camera raw")) << refusal;
}

}  // namespace
}  // namespace regrade
