// Colours of pictures with profiles, from the file to the staged photo.
#include "pipeline/images/color_profile.h"

#include <gtest/gtest.h>
#include <libheif/heif.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "pipeline/capture/ingest_photos.h"
#include "tests/pipeline/color_files.h"
#include "tests/pipeline/picture_corpus.h"

namespace regrade {
namespace {

using testing::Contains;
using testing::EncodedIn;
using testing::IccProfile;
using testing::kAdobePrimaries;
using testing::kP3Primaries;
using testing::kSrgbPrimaries;
using testing::LargestDifference;
using testing::MeanDifference;
using testing::Photo;
using testing::Primaries;
using testing::WriteWithProfile;

const OIIO::TypeDesc k8 = OIIO::TypeDesc::UINT8, k16 = OIIO::TypeDesc::UINT16;

std::string P3() { return IccProfile(kP3Primaries, 0, "Display P3"); }
std::string Adobe() { return IccProfile(kAdobePrimaries, 563 / 256.0, "Adobe RGB (1998)"); }

class ColorProfile : public testing::PictureTest {};

// Every colour that sRGB holds comes back, within what the file's bits can say.
TEST_F(ColorProfile, H145_P3AndAdobeRgbCopiesAreTheSamePicture) {
  const Image srgb = Photo(160, 120, 4);
  struct Copy {
    const char* file;
    Primaries primaries;
    double gamma;
    std::string icc;
    OIIO::TypeDesc type;
    double tolerance;
  };
  // 16 bits: profiles store numbers with 16 bits, and near black the curve's slope is 12.92.
  // 8 bits: a dark value beside light ones carries their half steps, times that slope; on
  // average it is a fraction of a step.
  const Copy copies[] = {{"p3.tif", kP3Primaries, 0, P3(), k16, 1e-3},
                         {"adobe.tif", kAdobePrimaries, 563 / 256.0, Adobe(), k16, 1e-3},
                         {"p3.png", kP3Primaries, 0, P3(), k16, 1e-3},
                         {"p3_8.png", kP3Primaries, 0, P3(), k8, 6.0 / 255},
                         {"adobe_8.tif", kAdobePrimaries, 563 / 256.0, Adobe(), k8, 6.0 / 255}};
  for (const Copy& copy : copies) {
    const Image encoded = EncodedIn(copy.primaries, copy.gamma, srgb);
    EXPECT_GT(LargestDifference(encoded, srgb), 0.02) << "the profile matters";
    WriteWithProfile(scratch_ / copy.file, encoded, copy.icc, copy.type);
    const DecodedPhoto photo = DecodePhoto(scratch_ / copy.file);
    const double worst = LargestDifference(photo.image, srgb);
    EXPECT_LT(worst, testing::RecordBound(std::string("colours of ") + copy.file,
                                          testing::Computed::kFloat, worst, copy.tolerance));
    EXPECT_LT(MeanDifference(photo.image, srgb), 0.5 / 255);
    EXPECT_TRUE(
        Contains(photo.colors, copy.primaries == kP3Primaries ? "Display P3" : "Adobe"));
    EXPECT_EQ(photo.notice, "");
  }
}

// What the picture said before profiles were read, it still says, to the bit.
TEST_F(ColorProfile, H145_ASrgbProfileChangesNothing) {
  const Image image = Photo(96, 64, 1);
  WriteWithProfile(scratch_ / "a.png", image, IccProfile(kSrgbPrimaries, 0, "any name"), k8);
  cmsHPROFILE standard = cmsCreate_sRGBProfile();
  cmsUInt32Number size = 0;
  cmsSaveProfileToMem(standard, nullptr, &size);
  std::string icc(size, '\0');
  cmsSaveProfileToMem(standard, icc.data(), &size);
  cmsCloseProfile(standard);
  WriteWithProfile(scratch_ / "b.png", image, icc, k8);
  WriteWithProfile(scratch_ / "c.png", image, "", k8);
  for (const char* file : {"a.png", "b.png"}) {
    const DecodedPhoto photo = DecodePhoto(scratch_ / file);
    EXPECT_EQ(photo.image.pixels, DecodePhoto(scratch_ / "c.png").image.pixels) << file;
    EXPECT_EQ(photo.colors, "");
    EXPECT_EQ(photo.notice, "");
  }
}

TEST_F(ColorProfile, H145_WhatSrgbDoesNotHoldIsClippedAndCounted) {
  Image image(64, 64, 3);
  std::fill(image.pixels.begin(), image.pixels.end(), 0.5f);
  // A quarter of the pixels is P3's pure green: red and blue of sRGB are negative, green is
  // above 1.
  for (int i = 0; i < 64 * 16; ++i) {
    image.pixels[3 * i] = image.pixels[3 * i + 2] = 0;
    image.pixels[3 * i + 1] = 1;
  }
  WriteWithProfile(scratch_ / "a.png", image, P3(), k8);
  const DecodedPhoto photo = DecodePhoto(scratch_ / "a.png");
  EXPECT_NEAR(photo.clipped, 0.25, 1e-9);
  EXPECT_EQ(photo.image.pixels[0], 0);
  EXPECT_EQ(photo.image.pixels[1], 1);
  EXPECT_NEAR(photo.image.pixels[3 * 64 * 32], 128 / 255.0, 1e-3) << "grey stays";
}

TEST_F(ColorProfile, H145_OneSentenceForAllPhotos) {
  for (int i = 0; i < 4; ++i)
    WriteWithProfile(scratch_ / "in" + std::to_string(i) + ".png", Photo(96, 64, 10 + i), P3(),
                     k8);
  std::filesystem::create_directory(scratch_ / "in");
  for (int i = 0; i < 4; ++i)
    std::filesystem::rename(scratch_ / "in" + std::to_string(i) + ".png",
                            scratch_ / "in/" + std::to_string(i) + ".png");
  const IngestResult result = IngestPhotos(scratch_ / "in", scratch_ / "out", {}, {});
  ASSERT_EQ(result.notices.size(), 1u);
  EXPECT_TRUE(Contains(result.notices[0], "4 photos: colours were converted from Display P3"))
      << result.notices[0];
  for (const PhotoStatus& status : result.statuses) EXPECT_EQ(status.why, "");
}

TEST_F(ColorProfile, GreyAndTransparentPicturesKeepTheirForm) {
  const Image grey = Photo(96, 64, 1, 1);
  const std::unique_ptr<cmsToneCurve, decltype(&cmsFreeToneCurve)> curve(
      cmsBuildGamma(nullptr, 1.8), cmsFreeToneCurve);
  const cmsCIExyY white = {0.3457, 0.3585, 1};  // D50
  cmsHPROFILE profile = cmsCreateGrayProfile(&white, curve.get());
  cmsUInt32Number size = 0;
  cmsSaveProfileToMem(profile, nullptr, &size);
  std::string icc(size, '\0');
  cmsSaveProfileToMem(profile, icc.data(), &size);
  cmsCloseProfile(profile);
  WriteWithProfile(scratch_ / "g.png", grey, icc, k16);
  const DecodedPhoto photo = DecodePhoto(scratch_ / "g.png");
  for (int i = 0; i < 96 * 64; i += 97) {
    const double light = std::pow(grey.pixels[i], 1.8);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(photo.image.pixels[3 * i + c], SrgbFromLinear(light), 2e-3);
  }
  Image cut_out = Photo(96, 64, 2, 4);
  WriteWithProfile(scratch_ / "a.png", cut_out, P3(), k16);
  const Image read = DecodePhoto(scratch_ / "a.png").image;
  ASSERT_EQ(read.channels, 4);
  for (int i = 0; i < 96 * 64; i += 31)
    EXPECT_NEAR(read.pixels[4 * i + 3], cut_out.pixels[4 * i + 3], 1e-4);
  // A profile of another colour space is named and not applied.
  WriteWithProfile(scratch_ / "x.tif", Photo(96, 64, 1), icc, k8);
  const DecodedPhoto other = DecodePhoto(scratch_ / "x.tif");
  EXPECT_TRUE(Contains(other.notice, "does not fit the picture")) << other.notice;
  EXPECT_LT(LargestDifference(other.image, Photo(96, 64, 1)), 1e-6);
}

TEST_F(ColorProfile, H145_AdobeRgbOfACameraHasAMarkOnly) {
  WriteWithProfile(scratch_ / "a.jpg", Photo(96, 64, 3), "", k8);
  // EXIF: a directory that leads to the interoperability directory with its index "R03".
  using testing::Little, testing::TiffEntry;
  const std::string exif = std::string("Exif\0\0II*\0", 10) + Little(8, 4) + Little(1, 2) +
                           TiffEntry(0x8769, 4, 1, 26) + Little(0, 4) + Little(1, 2) +
                           TiffEntry(0xa005, 4, 1, 44) + Little(0, 4) + Little(1, 2) +
                           Little(1, 2) + Little(2, 2) + Little(4, 4) +
                           std::string("R03\0", 4) + Little(0, 4);
  const std::string jpeg = testing::ReadText(scratch_ / "a.jpg");
  EXPECT_EQ(DecodePhoto(scratch_ / "a.jpg").colors, "");
  const DecodedPhoto photo = DecodePhoto(Put("b.jpg", testing::WithSegment(jpeg, 0xe1, exif)));
  EXPECT_NE(photo.colors, "");
  // As with the profile itself.
  const std::string body = std::string("ICC_PROFILE\0\1\1", 14) + Adobe();
  const Image named = DecodePhoto(Put("c.jpg", testing::WithSegment(jpeg, 0xe2, body))).image;
  EXPECT_LT(LargestDifference(photo.image, named), 1e-3);
  EXPECT_GT(LargestDifference(DecodePhoto(scratch_ / "a.jpg").image, named), 0.03);
}

TEST_F(ColorProfile, H143_OpenExrOfOtherPrimariesBecomesSrgb) {
  const Image srgb = Photo(96, 64, 5);
  const Image light = testing::LinearIn(kP3Primaries, srgb);
  OIIO::ImageSpec spec(96, 64, 3, OIIO::TypeDesc::FLOAT);
  const float chromaticities[8] = {0.680f, 0.320f, 0.265f,  0.690f,
                                   0.150f, 0.060f, 0.3127f, 0.3290f};
  spec.attribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8), chromaticities);
  const auto output = OIIO::ImageOutput::create("openexr");
  ASSERT_TRUE(output && output->open(scratch_ / "a.exr", spec));
  ASSERT_TRUE(output->write_image(OIIO::TypeDesc::FLOAT, light.pixels.data()));
  ASSERT_TRUE(output->close());
  const DecodedPhoto photo = DecodePhoto(scratch_ / "a.exr");
  EXPECT_LT(LargestDifference(photo.image, srgb), 1e-3);
  EXPECT_TRUE(Contains(photo.colors, "linear light")) << photo.colors;
}

// A phone's picture: HEVC in a HEIF file with a profile.
TEST_F(ColorProfile, F91_AHeicOfAPhoneKeepsItsColours) {
  const Image srgb = Photo(128, 96, 6);
  const Image encoded = EncodedIn(kP3Primaries, 0, srgb);
  heif_context* context = heif_context_alloc();
  heif_encoder* encoder = nullptr;
  if (heif_context_get_encoder_for_format(context, heif_compression_HEVC, &encoder).code !=
      heif_error_Ok) {
    heif_context_free(context);
    GTEST_SKIP() << "libheif has no HEVC encoder here";
  }
  heif_image* picture = nullptr;
  heif_image_create(128, 96, heif_colorspace_RGB, heif_chroma_interleaved_RGB, &picture);
  heif_image_add_plane(picture, heif_channel_interleaved, 128, 96, 8);
  int stride = 0;
  uint8_t* plane = heif_image_get_plane(picture, heif_channel_interleaved, &stride);
  for (int y = 0; y < 96; ++y)
    for (int i = 0; i < 3 * 128; ++i)
      plane[y * stride + i] = static_cast<uint8_t>(encoded.at(0, y)[i] * 255.f + 0.5f);
  const std::string icc = P3();
  heif_image_set_raw_color_profile(picture, "prof", icc.data(), icc.size());
  heif_encoder_set_lossless(encoder, 1);
  heif_encoder_set_parameter_string(encoder, "chroma", "444");
  ASSERT_EQ(heif_context_encode_image(context, picture, encoder, nullptr, nullptr).code,
            heif_error_Ok);
  ASSERT_EQ(heif_context_write_to_file(context, (scratch_ / "IMG_1.HEIC").c_str()).code,
            heif_error_Ok);
  heif_image_release(picture);
  heif_encoder_release(encoder);
  heif_context_free(context);

  const DecodedPhoto photo = DecodePhoto(scratch_ / "IMG_1.HEIC");
  EXPECT_EQ(photo.colors, "Display P3");
  EXPECT_EQ(photo.bits, 8);
  // Without loss but for the way to YCbCr in 8 bits and back: two steps, which dark values
  // beside light ones take as several (as above).
  EXPECT_LT(LargestDifference(photo.image, srgb), 12.0 / 255);
  EXPECT_GT(LargestDifference(encoded, srgb), 20.0 / 255);
  // A half of it is refused by name.
  const std::string bytes = testing::ReadText(scratch_ / "IMG_1.HEIC");
  EXPECT_NE(testing::Refusal(Put("half.heic", bytes.substr(0, bytes.size() / 2))), "");
}

// Code points come before a gamma, as in browsers. PQ of 58 % is white.
TEST_F(ColorProfile, CodePointsOfPngAreApplied) {
  Image image = Photo(64, 64, 2);
  for (float& v : image.pixels) v = 0.58069f;
  const std::string png = EncodePng16(image);
  const std::string gamma("gAMA\0\1\x86\xa0", 8), pq("cICP\x09\x10\0\1", 8),
      srgb("cICP\x01\x0d\0\1", 8);
  const DecodedPhoto photo =
      DecodePhoto(Put("a.png", testing::WithChunk(testing::WithChunk(png, gamma), pq)));
  EXPECT_EQ(photo.colors, "BT.2020, PQ");
  EXPECT_NEAR(photo.image.pixels[0], 1, 1e-3);
  EXPECT_EQ(DecodePhoto(Put("b.png", testing::WithChunk(png, srgb))).image.pixels,
            DecodePhoto(Put("c.png", png)).image.pixels);
}

TEST(Cicp, CodePointsOfSrgbChangeNothing) {
  Image image = Photo(16, 16, 1);
  const std::vector<float> before = image.pixels;
  for (const int transfer : {0, 1, 2, 6, 13, 14, 15})
    EXPECT_EQ(LinearizeByCicp(transfer % 3, transfer, &image), "");
  EXPECT_EQ(image.pixels, before);
  EXPECT_EQ(CicpName(9, 16), "BT.2020, PQ");
  // BT.2408: PQ of 203 cd/m^2 is 58 % of the signal; 10000 is 100 %.
  Image white(1, 1, 3);
  white.pixels = {0.58069f, 0.58069f, 1.f};
  EXPECT_EQ(LinearizeByCicp(1, 16, &white), "sRGB's primaries, PQ");
  EXPECT_NEAR(white.pixels[0], 1, 1e-3);
  EXPECT_NEAR(white.pixels[2], 10000 / 203.0, 1e-2);
}

// BT.2100 and BT.2408: of a screen of 1000 cd/m^2, 75 % of HLG's signal is white of 203, 38 %
// is 18 % of that, 100 % the screen's peak. PQ's signals for the same light give the same.
TEST(Cicp, WhiteOfHlgIsThatOfPq) {
  for (const int primaries : {1, 9}) {
    for (const auto& [hlg, pq] :
         {std::pair{0.75f, 0.58069f}, {0.38f, 0.38085f}, {1.f, 0.7518f}}) {
      Image of_hlg(1, 1, 3), of_pq(1, 1, 3), grey(1, 1, 1);
      std::ranges::fill(of_hlg.pixels, hlg);
      std::ranges::fill(grey.pixels, hlg);
      std::ranges::fill(of_pq.pixels, pq);
      EXPECT_NE(LinearizeByCicp(primaries, 18, &of_hlg), "");
      LinearizeByCicp(primaries, 16, &of_pq);
      LinearizeByCicp(primaries, 18, &grey);
      for (int c = 0; c < 3; ++c)  // the standards round the signals to a few digits
        EXPECT_NEAR(of_hlg.pixels[c] / of_pq.pixels[c], 1, 0.02) << hlg;
      EXPECT_NEAR(grey.pixels[0], of_hlg.pixels[0], 1e-3);
      if (hlg == 0.75f) {
        EXPECT_NEAR(of_hlg.pixels[0], 1, 2e-3);
      }
    }
  }
  EXPECT_EQ(CicpName(9, 18), "BT.2020, HLG");
}

}  // namespace
}  // namespace regrade
