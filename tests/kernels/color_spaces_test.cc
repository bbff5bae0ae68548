#include "kernels/image/color_spaces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/image/hue_chroma.h"
#include "tests/support/floating_point_traps.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

double LargestDifference(const Vec3d& a, const Vec3d& b) {
  return std::max({std::abs(a.x - b.x), std::abs(a.y - b.y), std::abs(a.z - b.z)});
}

TEST(ColorSpaces, H149_AllGreyValuesSurviveEverySpace) {
  for (int v = 0; v < 256; ++v) {
    const Vec3d srgb{v / 255.0, v / 255.0, v / 255.0};
    const Vec3d linear = LinearFromSrgb(srgb);
    for (const Vec3d& back :
         {SrgbFromLinear(linear), SrgbFromLinear(LinearFromXyz(XyzFromLinear(linear))),
          SrgbFromLab(LabFromSrgb(srgb))}) {
      for (int c = 0; c < 3; ++c) EXPECT_EQ(std::lround(255 * back[c]), v);
      // The two pieces of the standard's curve differ by 3e-8 where they meet.
      EXPECT_LE(LargestDifference(back, srgb),
                testing::RecordDigits("greys, round trip", testing::Computed::kDouble,
                                      LargestDifference(back, srgb), 1e-7));
    }
    const Vec3d lab = LabFromSrgb(srgb);
    EXPECT_NEAR(std::hypot(lab.y, lab.z), 0, 1e-12);  // grey has no chroma
  }
}

TEST(ColorSpaces, H24_ColourCubeAndBlackSurviveLab) {
  EXPECT_EQ(LargestDifference(SrgbFromLab(LabFromSrgb({0, 0, 0})), {0, 0, 0}), 0);
  for (int r = 0; r <= 255; r += 5)
    for (int g = 0; g <= 255; g += 5)
      for (int b = 0; b <= 255; b += 5) {
        const Vec3d srgb{r / 255.0, g / 255.0, b / 255.0};
        const Vec3d back = SrgbFromLab(LabFromSrgb(srgb));
        ASSERT_LE(LargestDifference(back, srgb), 0.5 / 255) << r << ' ' << g << ' ' << b;
        // Much better than half a step: only the error at the curve's seam remains.
        ASSERT_LE(
            LargestDifference(back, srgb),
            testing::RecordDigits("the colour cube through Lab", testing::Computed::kDouble,
                                  LargestDifference(back, srgb), 1e-6));
      }
}

TEST(ColorSpaces, H28_ValuesOutsideTheCubeSurvive) {
  for (const Vec3d& srgb :
       {Vec3d{-0.2, 0.5, 1.3}, Vec3d{1.5, 1.5, -0.01}, Vec3d{-0.5, -0.5, -0.5}})
    EXPECT_LE(
        LargestDifference(SrgbFromLab(LabFromSrgb(srgb)), srgb),
        testing::RecordDigits("colours outside the cube", testing::Computed::kDouble,
                              LargestDifference(SrgbFromLab(LabFromSrgb(srgb)), srgb), 1e-6));
}

TEST(ColorSpaces, H29_NanIsNoColour) {
  const testing::MayBeNotFinite allowed;
  const double nan = std::nan("");
  for (const Vec3d& srgb : {Vec3d{nan, 0.5, 0.5}, Vec3d{0.5, nan, 0.5}, Vec3d{0.5, 0.5, nan}})
    EXPECT_FALSE(AllFinite(SrgbFromLab(LabFromSrgb(srgb))));
}

TEST(ColorSpaces, PublishedValues) {
  // Lindbloom's calculator, sRGB, D65, no adaptation; printed to four digits.
  EXPECT_LE(LargestDifference(LabFromSrgb({1, 0, 0}), {53.2408, 80.0925, 67.2032}), 2e-3);
  EXPECT_LE(LargestDifference(LabFromSrgb({0, 0, 1}), {32.2970, 79.1875, -107.8602}), 2e-3);
  EXPECT_LE(LargestDifference(LabFromSrgb({1, 1, 1}), {100, 0, 0}), 1e-12);
  EXPECT_LE(LargestDifference(XyzFromLinear({1, 1, 1}), {0.95047, 1, 1.08883}), 1e-5);
}

Image Halves(const Vec3f& left, const Vec3f& right) {
  Image image(8, 4);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 8; ++x)
      for (int c = 0; c < 3; ++c) image.at(x, y)[c] = x < 4 ? left[c] : right[c];
  return image;
}

TEST(HueChromaMask, OnlyMaskedPixelsCount) {
  const Image image = Halves({1, 0, 0}, {0, 0, 1});
  Image mask(8, 4, 1);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x) *mask.at(x, y) = 1;
  HueChroma masked, all;
  masked.Add(image, &mask);
  all.Add(image);
  EXPECT_NEAR(*masked.MeanChroma(), std::hypot(80.0925, 67.2032), 2e-3);
  EXPECT_NEAR(*masked.HueStd(), 0, 1e-6);
  EXPECT_GT(*all.HueStd(), 0.5);
  const Image small(4, 4, 1);
  EXPECT_THROW(masked.Add(image, &small), CheckFailure);
}

}  // namespace
}  // namespace regrade
