#include "evaluate/fidelity.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "evaluate/sliced_wasserstein.h"
#include "kernels/base/error.h"
#include "kernels/image/hue_chroma.h"
#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

using namespace regrade::testing;

Image Colour(int width, int height, float r, float g, float b) {
  Image image(width, height, 3);
  for (int i = 0; i < width * height; ++i) {
    image.pixels[3 * i] = r;
    image.pixels[3 * i + 1] = g;
    image.pixels[3 * i + 2] = b;
  }
  return image;
}

Image SideBySide(const Image& a, const Image& b) {
  Image image(a.width + b.width, a.height, 3);
  for (int y = 0; y < a.height; ++y) {
    std::copy_n(a.at(0, y), 3 * a.width, image.at(0, y));
    std::copy_n(b.at(0, y), 3 * b.width, image.at(a.width, y));
  }
  return image;
}

TEST(HueChroma, PublishedLabValuesOfPureColours) {
  // CIELAB of sRGB red: a 80.09, b 67.20; of blue: a 79.19, b -107.86 (D65).
  HueChroma red, blue;
  red.Add(Colour(4, 4, 1, 0, 0));
  blue.Add(Colour(4, 4, 0, 0, 1));
  EXPECT_NEAR(*red.MeanChroma(), std::hypot(80.09, 67.20), 0.02);
  EXPECT_NEAR(*blue.MeanChroma(), std::hypot(79.19, -107.86), 0.02);
  EXPECT_NEAR(*red.HueStd(), 0, 1e-6);

  // Both side by side: R from the vectors.
  HueChroma both;
  both.Add(SideBySide(Colour(4, 4, 1, 0, 0), Colour(4, 4, 0, 0, 1)));
  const double r = std::hypot(80.09 + 79.19, 67.20 - 107.86) /
                   (std::hypot(80.09, 67.20) + std::hypot(79.19, 107.86));
  EXPECT_NEAR(*both.HueStd(), std::sqrt(-2 * std::log(r)), 1e-4);
}

TEST(HueChroma, GreyHasNoHueAndNanIsIgnored) {
  HueChroma grey;
  EXPECT_FALSE(grey.HueStd() || grey.MeanChroma());
  grey.Add(Colour(5, 5, 0.3f, 0.3f, 0.3f));
  EXPECT_NEAR(*grey.MeanChroma(), 0, 1e-9);
  EXPECT_FALSE(grey.HueStd());
  Image spoiled = Colour(5, 5, 1, 0, 0);
  spoiled.at(2, 2)[1] = kNan;
  HueChroma red;
  red.Add(spoiled);
  EXPECT_NEAR(*red.HueStd(), 0, 1e-6);
}

TEST(SlicedWasserstein, KnownDistances) {
  ColourSlices a, same, moved;
  const Image noise = NoiseImage(64, 64, 1);
  a.Add(noise);
  Image shuffled = noise;  // positions do not matter
  for (int i = 0; i < 32 * 64; ++i)
    for (int c = 0; c < 3; ++c)
      std::swap(shuffled.pixels[3 * i + c], shuffled.pixels[3 * (64 * 64 - 1 - i) + c]);
  same.Add(shuffled);
  EXPECT_EQ(*SlicedWasserstein(a, same), 0);

  // Two single colours at distance r: r times the root mean square of cos over 64 directions,
  // 1 / sqrt(3) up to their spread.
  ColourSlices dark, bright;
  dark.Add(Colour(8, 8, 0.2f, 0.2f, 0.2f));
  bright.Add(Colour(16, 16, 0.6f, 0.2f, 0.5f));  // another size: counts do not matter
  EXPECT_NEAR(*SlicedWasserstein(dark, bright), 0.5 / std::sqrt(3), 0.03);
  EXPECT_DOUBLE_EQ(*SlicedWasserstein(dark, bright), *SlicedWasserstein(bright, dark));

  EXPECT_FALSE(SlicedWasserstein(a, moved));
}

TEST(SlicedWasserstein, LargePicturesAreSampledEvenly) {
  // Red with a blue lower right quarter.
  const auto picture = [](int width, int height) {
    Image image =
        SideBySide(Colour(width / 2, height, 1, 0, 0), Colour(width / 2, height, 1, 0, 0));
    for (int y = height / 2; y < height; ++y)
      for (int x = width / 2; x < width; ++x) image.at(x, y)[0] = 0, image.at(x, y)[2] = 1;
    return image;
  };
  ColourSlices large, small;
  large.Add(picture(800, 500));
  small.Add(picture(8, 10));
  EXPECT_LE(large.count(), 65536);
  EXPECT_GT(large.count(), 20000);
  // One column of one colour is 1/267 of the picture at distance sqrt(2): 0.05. The first 65536
  // pixels alone are all red: 0.4.
  EXPECT_NEAR(*SlicedWasserstein(large, small), 0, 0.06);
}

TEST(Fidelity, GreyVideoScoresPoorly) {
  const Image style =
      SideBySide(Colour(20, 40, 0.9f, 0.5f, 0.1f), Colour(20, 40, 0, 0.3f, 0.7f));
  const FrameSource target = Frames({style, style});
  const FrameSource grey = Frames({ConstantImage(40, 40, 0.4f), ConstantImage(40, 40, 0.4f)});
  FidelityTargets targets;
  targets.views_2d = target;
  targets.style = &style;
  const FidelityRow honest = MeasureFidelity({"target", target}, targets);
  const FidelityRow trap = MeasureFidelity({"grey", grey}, targets);
  EXPECT_TRUE(std::isinf(*honest.psnr_to_2d_db));
  EXPECT_EQ(*honest.sliced_wasserstein_to_style, 0);
  EXPECT_EQ(*honest.hue_std, *honest.hue_std_2d);
  EXPECT_LT(*trap.psnr_to_2d_db, 15);
  EXPECT_GT(*trap.sliced_wasserstein_to_style, 0.1);
  EXPECT_FALSE(trap.hue_std);
  EXPECT_GT(*trap.hue_std_2d, 0.5);
  EXPECT_LT(*trap.chroma, 1e-6);
}

TEST(Fidelity, StructureIsLostToNoiseAndNotToColour) {
  Image before(40, 30), darker(40, 30), noisy(40, 30);
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 40; ++x)
      for (int c = 0; c < 3; ++c) {
        const float v = (x / 8 + y / 6) % 2 == 0 ? 0.3f : 0.7f;
        before.at(x, y)[c] = v;
        darker.at(x, y)[c] = 0.2f + 0.5f * v;
        noisy.at(x, y)[c] =
            v + 0.3f * (static_cast<float>((x * 7919 + y * 104729) % 101) / 101 - 0.5f);
      }
  FidelityTargets targets;
  EXPECT_FALSE(MeasureFidelity({"s", Frames({darker})}, targets).structure);
  targets.unstyled = Frames({before});
  EXPECT_NEAR(*MeasureFidelity({"s", Frames({darker})}, targets).structure, 1, 1e-5);
  EXPECT_LT(*MeasureFidelity({"s", Frames({noisy})}, targets).structure, 0.9);
}

TEST(Fidelity, PsnrClipsBothAndExcludesEmptySpace) {
  Image frame = ConstantImage(20, 20, 1.7f), target = ConstantImage(20, 20, 0.9f);
  Image transmittance(20, 20, 1);
  frame.at(2, 2)[0] = -5;
  *transmittance.at(2, 2) = 0.9f;
  FidelityTargets targets;
  targets.views_2d = Frames({target, target});
  targets.transmittance = Frames({transmittance, transmittance});
  // The second frame is perfect: excluded from the mean, which would be infinite.
  const FidelityRow row = MeasureFidelity({"s", Frames({frame, target})}, targets);
  EXPECT_NEAR(*row.psnr_to_2d_db, 20, 1e-4);
  EXPECT_FALSE(row.sliced_wasserstein_to_style);
}

TEST(Fidelity, MismatchesAreClearErrors) {
  FidelityTargets targets;
  targets.views_2d = Frames({ConstantImage(20, 20, 0)});
  const auto measure = [&](const FrameSource& frames) {
    MeasureFidelity({"s", frames}, targets);
  };
  EXPECT_REGRADE_ERROR(measure(Frames({ConstantImage(20, 20, 0), ConstantImage(20, 20, 0)})),
                       ExitCode::kInput);
  EXPECT_REGRADE_ERROR(measure(Frames({ConstantImage(21, 20, 0)})), ExitCode::kInput);
  measure(Frames({ConstantImage(20, 20, 0)}));
}

}  // namespace
}  // namespace regrade
