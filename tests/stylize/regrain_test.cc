// Taking back the grain that a transfer of colours made louder.
#include "stylize/image/regrain.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/base/random.h"
#include "stylize/image/distribution_transfer.h"
#include "tests/support/expect_error.h"
#include "tests/support/floating_point_traps.h"

namespace regrade {
namespace {

// Three plain fields with grain of half a percent: where a distribution is narrow, the transfer
// is steep.
Image GrainyPhoto(double grain = 0.008) {
  Image image(120, 80);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const double base = x < 40 ? 0.3 : x < 80 ? 0.45 : 0.6;
      for (int c = 0; c < 3; ++c)
        image.at(x, y)[c] = static_cast<float>(
            base + 0.05 * c + 0.03 * y / 80.0 +
            grain * (RandomDouble(3, static_cast<uint64_t>(c),
                                  static_cast<uint64_t>(y * image.width + x)) -
                     0.5));
    }
  return image;
}

// Colours over the whole cube: from the narrow photo to it the map is steep.
Image WideStyle() {
  Image image(64, 64);
  for (int64_t i = 0; i < image.num_pixels(); ++i)
    for (int c = 0; c < 3; ++c)
      image.pixels[static_cast<size_t>(3 * i + c)] = static_cast<float>(
          RandomDouble(9, static_cast<uint64_t>(c), static_cast<uint64_t>(i)));
  return image;
}

// Spread of the differences of neighbours within the plain fields.
double Grain(const Image& image) {
  double sum = 0;
  int count = 0;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x + 1 < image.width; ++x) {
      if (x % 40 > 34 || x % 40 < 4) continue;
      for (int c = 0; c < 3; ++c) {
        const double d = image.at(x + 1, y)[c] - image.at(x, y)[c];
        sum += d * d;
        ++count;
      }
    }
  return std::sqrt(sum / count);
}

Vec3d MeanOf(const Image& image, int x0, int x1) {
  Vec3d sum;
  for (int y = 0; y < image.height; ++y)
    for (int x = x0; x < x1; ++x)
      for (int c = 0; c < 3; ++c) sum[c] += image.at(x, y)[c];
  return sum / (1.0 * image.height * (x1 - x0));
}

Image Styled(const Image& photo, bool regrain) {
  StyleOptions options;
  options.method = "idt";
  options.regrain = regrain;
  return MakeDistributionTransfer(options, WideStyle())->Stylize(photo, 0);
}

TEST(Regrain, GrainGetsNoLouderThanThePhotos) {
  const Image photo = GrainyPhoto(), loud = Styled(photo, false), quiet = Styled(photo, true);
  EXPECT_GT(Grain(loud), 3 * Grain(photo));      // what has to be taken back
  EXPECT_LE(Grain(quiet), 1.25 * Grain(photo));  // the transfer's own slopes remain, no noise
  // The fields have the colours that the transfer gave them: a step of 8 bits or two is the
  // slope of the plain parts, which follow their neighbours.
  for (const int x : {0, 40, 80})
    EXPECT_LE(Norm(MeanOf(quiet, x + 5, x + 35) - MeanOf(loud, x + 5, x + 35)), 0.08) << x;
}

TEST(Regrain, TheTransferIsKeptWhereItOnlyMovesColours) {
  const Image photo = GrainyPhoto();
  Image moved = photo;
  for (float& v : moved.pixels) v += 0.125f;
  const Image result = Regrain(photo, moved);
  double worst = 0;
  for (size_t i = 0; i < moved.pixels.size(); ++i)
    worst = std::max<double>(worst, std::abs(result.pixels[i] - moved.pixels[i]));
  EXPECT_LE(worst, 2e-3);  // the solver stops at a thousandth
}

TEST(Regrain, PlainTinyAndOddPicturesStayFinite) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 7}, {33, 21}, {81, 43}}) {
    Image plain(width, height), moved(width, height);
    std::fill(plain.pixels.begin(), plain.pixels.end(), 0.5f);
    std::fill(moved.pixels.begin(), moved.pixels.end(), 0.75f);
    for (const float v : Regrain(plain, moved).pixels) EXPECT_NEAR(v, 0.75f, 1e-3);
  }
}

TEST(Regrain, OtherMethodsRefuseIt) {
  StyleOptions options;
  options.regrain = true;
  EXPECT_REGRADE_ERROR(ParseStyleMethod(options), ExitCode::kUsage, "--style-regrain");
  options.method = "idt";
  EXPECT_EQ(ParseStyleMethod(options).kind, StyleMethodKind::kIdt);
}

TEST(Regrain, OffIsTheTransferItself) {
  const Image photo = GrainyPhoto();
  StyleOptions options;
  options.method = "idt";
  EXPECT_FALSE(options.regrain);
  const Image twice = Styled(photo, false);
  EXPECT_EQ(MakeDistributionTransfer(options, WideStyle())->Stylize(photo, 0).pixels,
            twice.pixels);
}

TEST(Regrain, H29_PixelsThatAreNotFiniteSpoilNoOthers) {
  const testing::MayBeNotFinite allowed;
  Image photo = GrainyPhoto();
  photo.at(60, 40)[1] = std::numeric_limits<float>::quiet_NaN();
  const Image styled = Styled(photo, true);
  int bad = 0;
  for (const float v : styled.pixels) bad += !std::isfinite(v);
  EXPECT_EQ(bad, 1);
}

}  // namespace
}  // namespace regrade
