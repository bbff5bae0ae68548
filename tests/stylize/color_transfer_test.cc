#include "stylize/image/color_transfer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/image/color_spaces.h"
#include "tests/support/expect_error.h"
#include "tests/support/floating_point_traps.h"
#include "tests/support/record_error.h"
#include "tests/support/wavy_picture.h"

namespace regrade {
namespace {

using testing::LargestDifference;
using testing::OneColour;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// Normal-looking colours: mean + mix * three independent sums of uniforms.
Image Cloud(uint64_t seed, const Vec3d& mean, const Mat3d& mix, int width = 48,
            int height = 40) {
  Image image(width, height);
  for (int64_t i = 0; i < image.num_pixels(); ++i) {
    Vec3d noise;
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 4; ++k) noise[c] += RandomDouble(seed, 4 * c + k, i) - 0.5;
    const Vec3d color = mean + mix * noise;
    for (int c = 0; c < 3; ++c) image.pixels[3 * i + c] = static_cast<float>(color[c]);
  }
  return image;
}

const Mat3d kPhotoMix{{{0.15, 0.02, 0}, {0.12, 0.06, 0.01}, {0.1, 0.03, 0.05}}};
const Mat3d kStyleMix{{{0.12, 0.05, 0}, {0.05, 0.08, 0.02}, {-0.04, 0.03, 0.09}}};
Image Photo(uint64_t seed = 1) { return Cloud(seed, {0.45, 0.5, 0.4}, kPhotoMix); }
Image Style() { return Cloud(2, {0.6, 0.45, 0.3}, kStyleMix); }

StyleOptions Method(const std::string& method, bool scene_wide = false) {
  return {.method = method, .scene_wide = scene_wide};
}

Image Styled(const std::string& method, const Image& photo, const Image& style) {
  return MakeColorTransfer(Method(method), style)->Stylize(photo, 0);
}

TEST(ColorTransfer, MklMeetsMeanAndCovarianceOfTheStyle) {
  const ColorStatistics styled = MeasureColor(Styled("mkl", Photo(), Style()));
  const ColorStatistics style = MeasureColor(Style());
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(styled.mean[i], style.mean[i],
                testing::RecordBound("the style's mean", testing::Computed::kFloat,
                                     styled.mean[i] - style.mean[i],
                                     1e-8));  // values are stored as floats
    for (int j = 0; j < 3; ++j)
      EXPECT_NEAR(styled.covariance(i, j), style.covariance(i, j), 1e-8);
  }
}

TEST(ColorTransfer, ReinhardMeetsMeanAndSpreadOfEachLabChannel) {
  const ColorStatistics styled =
      MeasureColor(Styled("reinhard", Photo(), Style()), LabFromSrgb);
  const ColorStatistics style = MeasureColor(Style(), LabFromSrgb);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(styled.mean[c], style.mean[c], 1e-5);
    EXPECT_NEAR(styled.covariance(c, c), style.covariance(c, c), 1e-4);
  }
}

TEST(ColorTransfer, H25_IdentityOnTheStyleItselfAndDifferentElsewhere) {
  for (const char* method : {"mkl", "reinhard"})
    EXPECT_LE(LargestDifference(Styled(method, Style(), Style()), Style()),
              testing::RecordBound("a pixel of the style on itself", testing::Computed::kFloat,
                                   LargestDifference(Styled(method, Style(), Style()), Style()),
                                   2e-7))
        << method;
  const ColorStatistics lab = MeasureColor(Style(), LabFromSrgb);
  const ChannelMap map = ComputeReinhard(lab, lab);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(map.slope[c], 1, 1e-12);
    EXPECT_NEAR(map.offset[c], 0, 1e-12);
  }
  EXPECT_GE(
      LargestDifference(Styled("mkl", Photo(), Style()), Styled("reinhard", Photo(), Style())),
      0.05);
}

TEST(ColorTransfer, H23_ConstantChannelsTakeTheStylesMean) {
  // A grey photo: its CIELAB a and b are 1e-15, not 0, and must not be blown up to the style.
  Image grey(64, 4);
  for (int64_t i = 0; i < grey.num_pixels(); ++i)
    for (int c = 0; c < 3; ++c) grey.pixels[3 * i + c] = static_cast<float>(i % 200) / 255.0f;
  const ColorStatistics style = MeasureColor(Style(), LabFromSrgb);
  const ChannelMap map = ComputeReinhard(MeasureColor(grey, LabFromSrgb), style);
  EXPECT_GT(map.slope.x, 0);
  EXPECT_EQ(map.slope.y, 0);
  EXPECT_EQ(map.slope.z, 0);
  const Image styled = Styled("reinhard", grey, Style());
  const ColorStatistics result = MeasureColor(styled, LabFromSrgb);
  EXPECT_NEAR(result.mean.y, style.mean.y, 1e-4);
  EXPECT_LE(result.covariance(1, 1), 1e-6);
  // One colour: every channel is constant.
  const Image flat = Styled("reinhard", OneColour(16, 16, {0.2, 0.5, 0.9}), Style());
  const Vec3d mean = SrgbFromLab(style.mean);
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(
        flat.pixels[c], mean[c],
        testing::RecordBound("one colour to the style's mean", testing::Computed::kFloat,
                             flat.pixels[c] - mean[c], 1e-6));
}

TEST(ColorTransfer, H24_BlackPicturesStayFinite) {
  for (const char* method : {"mkl", "reinhard"}) {
    const Image black = OneColour(16, 16, {0, 0, 0});
    for (const float v : Styled(method, black, Style()).pixels) ASSERT_TRUE(std::isfinite(v));
    for (const float v : Styled(method, Photo(), black).pixels)
      ASSERT_NEAR(v, 0,
                  testing::RecordBound("a black style", testing::Computed::kFloat, v, 1e-6));
    EXPECT_EQ(LargestDifference(Styled(method, black, black), black), 0);
  }
}

TEST(ColorTransfer, H7_AFlatStyleIsSaid) {
  for (const char* method : {"mkl", "reinhard"}) {
    const auto stylizer = MakeColorTransfer(Method(method), OneColour(16, 16, {0.2, 0.4, 0.6}));
    ASSERT_EQ(stylizer->Notices().size(), 1u);
    EXPECT_NE(stylizer->Notices()[0].find("single colour"), std::string::npos);
    EXPECT_LE(
        LargestDifference(stylizer->Stylize(Photo(), 0), OneColour(48, 40, {0.2, 0.4, 0.6})),
        1e-6);
    EXPECT_TRUE(MakeColorTransfer(Method(method), Style())->Notices().empty());
  }
}

TEST(ColorTransfer, H28_ValuesOutsideTheCubeAreKept) {
  const Image bright = Cloud(4, {0.9, 0.9, 0.1}, kStyleMix);
  for (const char* method : {"mkl", "reinhard"}) {
    const Image styled = Styled(method, Photo(), bright);
    EXPECT_GT(*std::max_element(styled.pixels.begin(), styled.pixels.end()), 1.02f) << method;
    EXPECT_LT(*std::min_element(styled.pixels.begin(), styled.pixels.end()), -0.02f) << method;
  }
}

TEST(ColorTransfer, H29_FewNansPassManyStopWithTheViewsName) {
  const testing::MayBeNotFinite allowed;
  for (const char* method : {"mkl", "reinhard"}) {
    const auto stylizer = MakeColorTransfer(Method(method), Style());
    Image photo = Photo();  // 1920 pixels
    for (int i = 0; i < 19; ++i) photo.at(i, 7)[1] = kNan;
    const Image styled = stylizer->Stylize(photo, 7);
    EXPECT_EQ(CountNotFinite(styled, ""), 19);
    photo.at(30, 30)[0] = std::numeric_limits<float>::infinity();
    EXPECT_REGRADE_ERROR(stylizer->Stylize(photo, 7), ExitCode::kInput,
                         "view 7: 20 of 1920 pixels are not finite numbers");
  }
}

TEST(ColorTransfer, H27_AStyledViewKeepsItsSize) {
  const Image view(16, 9);
  EXPECT_EQ(CheckStyledView(view, Image(16, 9), "view 3"), 0);
  for (const Image& styled : {Image(16, 8), Image(15, 9), Image(16, 9, 4)})
    EXPECT_REGRADE_ERROR(CheckStyledView(view, styled, "view 3"), ExitCode::kExternalProgram,
                         "view 3: ");
}

TEST(ColorTransfer, H30_ASceneWideMapIsTheSameInAllViews) {
  // Two views of other colours that share one: per view it flickers, scene-wide it does not.
  Image a = Photo(1), b = Cloud(5, {0.3, 0.35, 0.5}, kPhotoMix);
  for (int c = 0; c < 3; ++c) a.at(3, 3)[c] = b.at(3, 3)[c] = 0.4f;
  for (const char* method : {"mkl", "reinhard"}) {
    const StyleOptions options = Method(method, true);
    const ColorStatistics scene =
        Pool({MeasureForMethod(options, a), MeasureForMethod(options, b)});
    const auto steady = MakeColorTransfer(options, Style(), &scene);
    const auto single = MakeColorTransfer(Method(method), Style());
    double steady_difference = 0, difference = 0;
    const Image steady_a = steady->Stylize(a, 0), steady_b = steady->Stylize(b, 1),
                single_a = single->Stylize(a, 0), single_b = single->Stylize(b, 1);
    for (int c = 0; c < 3; ++c) {
      steady_difference += std::abs(steady_a.at(3, 3)[c] - steady_b.at(3, 3)[c]);
      difference += std::abs(single_a.at(3, 3)[c] - single_b.at(3, 3)[c]);
    }
    EXPECT_TRUE(testing::RecordSameBits("one colour in two views", testing::Computed::kFloat,
                                        steady_difference == 0))
        << method;
    EXPECT_GE(difference, 0.05) << method;
  }
}

TEST(ColorTransfer, AlphaStaysAndTransparentColoursAreIgnored) {
  const Image photo = Photo();
  Image rgba(photo.width, photo.height, 4);
  for (int64_t i = 0; i < photo.num_pixels(); ++i) {
    for (int c = 0; c < 3; ++c) rgba.pixels[4 * i + c] = photo.pixels[3 * i + c];
    rgba.pixels[4 * i + 3] = 1;
  }
  Image framed(photo.width, photo.height + 10, 4);  // ten rows of transparent black
  std::copy(rgba.pixels.begin(), rgba.pixels.end(), framed.pixels.begin());
  const Image styled = Styled("mkl", framed, Style()), plain = Styled("mkl", photo, Style());
  EXPECT_EQ(styled.at(3, 5)[3], 1);
  EXPECT_EQ(styled.at(3, photo.height + 2)[3], 0);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(styled.at(3, 5)[c], plain.at(3, 5)[c], 1e-6);
  // Nothing but air: the error knows the view.
  EXPECT_REGRADE_ERROR(MakeColorTransfer(Method("mkl"), Style())->Stylize(Image(4, 4, 4), 12),
                       ExitCode::kInput, "view 12: ");
}

TEST(ColorTransfer, ASceneWideMapNeedsTheScene) {
  EXPECT_THROW(MakeColorTransfer(Method("mkl", true), Style()), CheckFailure);
}

}  // namespace
}  // namespace regrade
