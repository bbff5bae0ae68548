// Camera raw files: a DNG of a synthetic mosaic, developed to sRGB.
#include <gtest/gtest.h>

#include <cmath>

#include "kernels/scene/srgb.h"
#include "tests/pipeline/picture_corpus.h"

namespace regrade {
namespace {

using testing::Contains;
using testing::Little;
using testing::TiffEntry;

// Light of six patches, linear sRGB: three greys, and colours.
constexpr double kPatches[6][3] = {{0.02, 0.02, 0.02}, {0.18, 0.18, 0.18}, {0.6, 0.6, 0.6},
                                   {0.5, 0.1, 0.1},    {0.1, 0.4, 0.15},   {0.1, 0.15, 0.5}};
constexpr int kPatch = 64, kWidth = 3 * kPatch, kHeight = 2 * kPatch;
// What the sensor sees of white: the camera's white balance divides by it.
constexpr double kNeutral[3] = {0.5, 1.0, 0.625};

std::string Rationals(std::initializer_list<double> values) {
  std::string bytes;
  for (const double value : values)
    bytes +=
        Little(static_cast<uint32_t>(static_cast<int32_t>(std::lround(value * 10000))), 4) +
        Little(10000, 4);
  return bytes;
}

// A mosaic RGGB of 16 bits through a sensor whose primaries are sRGB's.
std::string Dng(double exposure, int orientation = 1) {
  // XYZ of D65 to linear sRGB.
  const std::string matrix =
      Rationals({3.2405, -1.5371, -0.4985, -0.9693, 1.8760, 0.0416, 0.0556, -0.2040, 1.0572});
  const std::string neutral = Rationals({kNeutral[0], kNeutral[1], kNeutral[2]});
  constexpr int kEntries = 20;
  const uint32_t extra = 8 + 2 + kEntries * 12 + 4;
  const uint32_t at_neutral = extra + static_cast<uint32_t>(matrix.size());
  const uint32_t pixels = at_neutral + static_cast<uint32_t>(neutral.size());
  const uint32_t version = 1 | 4 << 8;                      // 1.4.0.0
  const uint32_t pattern = 0 | 1 << 8 | 1 << 16 | 2 << 24;  // RGGB
  std::string dng = std::string("II*\0", 4) + Little(8, 4) + Little(kEntries, 2);
  dng +=
      TiffEntry(254, 4, 1, 0) + TiffEntry(256, 4, 1, kWidth) + TiffEntry(257, 4, 1, kHeight) +
      TiffEntry(258, 3, 1, 16) + TiffEntry(259, 3, 1, 1) + TiffEntry(262, 3, 1, 32803) +
      TiffEntry(271, 2, 4, 0x00747365) + TiffEntry(272, 2, 4, 0x00747365) +  // "est"
      TiffEntry(273, 4, 1, pixels) + TiffEntry(274, 3, 1, static_cast<uint32_t>(orientation)) +
      TiffEntry(277, 3, 1, 1) + TiffEntry(278, 4, 1, kHeight) +
      TiffEntry(279, 4, 1, kWidth * kHeight * 2) + TiffEntry(33421, 3, 2, 2 | 2 << 16) +
      TiffEntry(33422, 1, 4, pattern) + TiffEntry(50706, 1, 4, version) +
      TiffEntry(50717, 4, 1, 65535) + TiffEntry(50721, 10, 9, extra) +
      TiffEntry(50728, 5, 3, at_neutral) + TiffEntry(50778, 3, 1, 21) + Little(0, 4);
  dng += matrix + neutral;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const int channel = y % 2 == 0 ? (x % 2 == 0 ? 0 : 1) : (x % 2 == 0 ? 1 : 2);
      const double light = kPatches[y / kPatch * 3 + x / kPatch][channel];
      dng += Little(
          static_cast<uint64_t>(std::lround(65535 * exposure * light * kNeutral[channel])), 2);
    }
  return dng;
}

class RawPhoto : public testing::PictureTest {};

TEST_F(RawPhoto, F93_IsDevelopedWithTheCamerasWhiteBalance) {
  const DecodedPhoto photo = DecodePhoto(Put("a.dng", Dng(1)));
  EXPECT_EQ(photo.bits, 16);
  // LibRaw leaves out a margin of no more than a few pixels.
  EXPECT_NEAR(photo.image.width, kWidth, 8);
  for (int patch = 0; patch < 6; ++patch)
    for (int c = 0; c < 3; ++c) {
      const int x = patch % 3 * kPatch + kPatch / 2, y = patch / 3 * kPatch + kPatch / 2;
      // Rounded matrix entries and LibRaw's integers: below a step of 8 bits.
      EXPECT_NEAR(photo.image.at(x, y)[c], SrgbFromLinear(kPatches[patch][c]), 1.0 / 255)
          << patch << " " << c;
    }
}

// The same light for the same exposure, whatever else is in the photo.
TEST_F(RawPhoto, F93_BrightnessIsNotChosenForEachPhoto) {
  const Image bright = DecodePhoto(Put("a.dng", Dng(1))).image;
  const Image dark = DecodePhoto(Put("b.dng", Dng(0.25))).image;
  for (int patch = 1; patch < 3; ++patch) {
    const int x = patch % 3 * kPatch + kPatch / 2, y = kPatch / 2;
    EXPECT_NEAR(LinearFromSrgb(dark.at(x, y)[1]), 0.25 * LinearFromSrgb(bright.at(x, y)[1]),
                2e-3);
  }
}

TEST_F(RawPhoto, F93_ComesUprightAndDamageIsRefused) {
  const Image turned = DecodePhoto(Put("a.dng", Dng(1, 6))).image;
  EXPECT_NEAR(turned.width, kHeight, 8);
  EXPECT_NEAR(turned.height, kWidth, 8);
  // The first patch, stored top left, is top right.
  EXPECT_LT(turned.at(turned.width - 20, 20)[1], 0.2f);
  EXPECT_GT(turned.at(20, 20)[0], 0.6f);
  const std::string dng = Dng(1);
  const std::string refusal = testing::Refusal(Put("c.dng", dng.substr(0, 300)));
  EXPECT_TRUE(Contains(refusal, "camera raw")) << refusal;
}

}  // namespace
}  // namespace regrade
