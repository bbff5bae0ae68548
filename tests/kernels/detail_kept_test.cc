// Detail kept: what blur, noise and sharpening do to it, and where it is not defined.
#include "kernels/image/detail_kept.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "kernels/base/random.h"
#include "kernels/image/resize.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr double kBlurs[] = {0.3, 0.5, 0.7, 1, 1.5, 2, 3};

// Discs of random colours that hide each other, radii with density r^-3: edges and spectrum of
// a photograph (Lee, Mumford and Huang 2001). Pixels are means of 2 x 2 samples.
Image Leaves(uint64_t seed, int width = 160, int height = 120) {
  Image fine(2 * width, 2 * height, 3);
  for (uint64_t disc = 0; disc < 4000; ++disc) {
    const auto random = [&](uint64_t k) { return RandomDouble(seed, disc, k); };
    const double radius = 2 / std::sqrt(1 - 0.9995 * random(0));
    const double cx = random(1) * fine.width, cy = random(2) * fine.height;
    const int top = std::max(0, static_cast<int>(cy - radius));
    for (int y = top; y < std::min<double>(fine.height, cy + radius); ++y)
      for (int x = std::max(0, static_cast<int>(cx - radius));
           x < std::min<double>(fine.width, cx + radius); ++x)
        if (std::hypot(x - cx, y - cy) < radius)
          for (int c = 0; c < 3; ++c)
            fine.at(x, y)[c] = static_cast<float>(0.1 + 0.8 * random(3 + c));
  }
  return Resize(fine, width, height);
}

// Edges repeated.
Image Blur(const Image& image, double sigma) {
  const int radius = static_cast<int>(std::ceil(4 * sigma));
  Image out = image;
  for (const auto& [dx, dy] : {std::pair{1, 0}, {0, 1}}) {
    const Image in = out;
    for (int y = 0; y < in.height; ++y)
      for (int x = 0; x < in.width; ++x)
        for (int c = 0; c < in.channels; ++c) {
          double sum = 0, norm = 0;
          for (int k = -radius; k <= radius; ++k) {
            const double tap = std::exp(-k * k / (2 * sigma * sigma));
            sum += tap * in.at(std::clamp(x + k * dx, 0, in.width - 1),
                               std::clamp(y + k * dy, 0, in.height - 1))[c];
            norm += tap;
          }
          out.at(x, y)[c] = static_cast<float>(sum / norm);
        }
  }
  return out;
}

Image UnsharpMask(const Image& image, double radius, double amount) {
  Image out = Blur(image, radius);
  for (size_t i = 0; i < out.pixels.size(); ++i) {
    const double sharper = image.pixels[i] + amount * (image.pixels[i] - out.pixels[i]);
    out.pixels[i] = static_cast<float>(std::clamp(sharper, 0.0, 1.0));
  }
  return out;
}

// White noise; `levels` of 255 is its standard deviation.
Image WithNoise(Image image, double levels, uint64_t seed) {
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    const double u = 1 - RandomDouble(seed, 7, i), v = RandomDouble(seed, 8, i);
    image.pixels[i] += static_cast<float>(levels / 255 * std::sqrt(-2 * std::log(u)) *
                                          std::cos(2 * 3.14159265358979 * v));
  }
  return image;
}

double Kept(const Image& render, const Image& photo) {
  return MeasureFineDetail(render, photo).kept.value();
}

TEST(DetailKept, APhotoKeepsAllOfItself) {
  const Image photo = Leaves(1);
  const FineDetail same = MeasureFineDetail(photo, photo);
  EXPECT_NEAR(*same.kept, 1, 1e-12);
  EXPECT_EQ(*same.levels, 0);
}

// The formula once more, window by window and with the two-dimensional Gaussian.
TEST(DetailKept, AgreesWithTheDefinition) {
  const Image photo = Leaves(2, 39, 21), render = WithNoise(Blur(photo, 0.6), 4, 3);
  const auto band = [](const Image& image) {
    const auto luma = [&](int x, int y) {
      const float* c = image.at(x, y);
      return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
    };
    std::vector<double> out;
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x) {
        double sum = 0, norm = 0;
        for (int v = std::max(0, y - 4); v <= std::min(image.height - 1, y + 4); ++v)
          for (int u = std::max(0, x - 4); u <= std::min(image.width - 1, x + 4); ++u) {
            const double tap = std::exp(-((u - x) * (u - x) + (v - y) * (v - y)) / 2.0);
            sum += tap * luma(u, v), norm += tap;
          }
        out.push_back(luma(x, y) - sum / norm);
      }
    return out;
  };
  const std::vector<double> r = band(render), p = band(photo);
  double kept = 0, energy = 0, squares = 0;
  for (int top = 0; top < photo.height; top += 16)
    for (int left = 0; left < photo.width; left += 16) {
      double rr = 0, rp = 0, pp = 0;
      for (int y = top; y < std::min(top + 16, photo.height); ++y)
        for (int x = left; x < std::min(left + 16, photo.width); ++x) {
          const size_t i = static_cast<size_t>(y) * photo.width + x;
          rr += r[i] * r[i], rp += r[i] * p[i], pp += p[i] * p[i];
          squares += (r[i] - p[i]) * (r[i] - p[i]);
        }
      kept += std::max(0.0, std::min(rp / pp, rp * rp / (rr * pp))) * pp;
      energy += pp;
    }
  const FineDetail detail = MeasureFineDetail(render, photo);
  EXPECT_NEAR(*detail.kept, kept / energy,
              testing::RecordDigits("detail kept against its definition",
                                    testing::Computed::kDouble, *detail.kept - kept / energy,
                                    1e-12));
  EXPECT_NEAR(*detail.levels, 255 * std::sqrt(squares / photo.num_pixels()), 1e-10);
}

TEST(DetailKept, BlurLowersIt) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Image photo = Leaves(seed);
    double last = 1, last_levels = 0;
    for (const double sigma : kBlurs) {
      const FineDetail detail = MeasureFineDetail(Blur(photo, sigma), photo);
      EXPECT_LT(*detail.kept, last) << sigma;
      EXPECT_GT(*detail.levels, last_levels) << sigma;
      last = *detail.kept, last_levels = *detail.levels;
    }
    EXPECT_LT(last, 0.06);
  }
}

// The words' limits: half a pixel of blur is about where a picture stops being sharp.
TEST(DetailKept, WordsFollowBlur) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Image photo = Leaves(seed);
    EXPECT_STREQ(SharpnessWord(Kept(photo, photo)), "sharp");
    EXPECT_STREQ(SharpnessWord(Kept(Blur(photo, 0.4), photo)), "sharp");
    EXPECT_STREQ(SharpnessWord(Kept(Blur(photo, 0.7), photo)), "slightly soft");
    EXPECT_STREQ(SharpnessWord(Kept(Blur(photo, 1.3), photo)), "soft");
  }
}

// Energy in the fine band is no detail: <r, r> / <p, p> would rise at every one of these.
TEST(DetailKept, NoiseDoesNotRaiseIt) {
  const Image photo = Leaves(1);
  for (const double sigma : {0.0, 0.5, 1.0, 2.0}) {
    const Image render = sigma > 0 ? Blur(photo, sigma) : photo;
    const double before = Kept(render, photo);
    for (const double levels : {2.0, 5.0, 10.0})
      for (const uint64_t seed : {11, 12, 13, 14})
        EXPECT_LE(Kept(WithNoise(render, levels, seed), photo) - before,
                  testing::RecordBound("rise by noise", testing::Computed::kDouble,
                                       Kept(WithNoise(render, levels, seed), photo) - before,
                                       0.01))
            << sigma << " " << levels;
  }
}

TEST(DetailKept, UnsharpMaskingASharpRenderDoesNotRaiseIt) {
  const Image photo = Leaves(1);
  // Sharp, with errors of a level: it is not clipped at 1.
  for (const Image& render : {photo, WithNoise(photo, 6, 5), Blur(photo, 0.25)})
    for (const double radius : {1.0, 2.0})
      for (const double amount : {0.5, 1.0})
        EXPECT_LE(Kept(UnsharpMask(render, radius, amount), photo), Kept(render, photo) + 0.01)
            << radius << " " << amount;
}

// A soft render is nearer to its photo after moderate sharpening, and the measure says so (the
// inverse of a blur returns the photo). The gain ends at the squared coherence.
TEST(DetailKept, SharpeningASoftRenderEndsAtItsCoherence) {
  const Image photo = Leaves(1), render = WithNoise(Blur(photo, 1), 3, 6);
  const auto scaled = [&](float gain) {  // of the fine band alone
    Image out = Blur(render, 1);
    for (size_t i = 0; i < out.pixels.size(); ++i)
      out.pixels[i] += gain * (render.pixels[i] - out.pixels[i]);
    return Kept(out, photo);
  };
  const double limit = scaled(32);
  EXPECT_LT(limit, 0.6);
  EXPECT_GT(scaled(2), Kept(render, photo) + 0.05);
  EXPECT_NEAR(scaled(64), limit, 0.005);
}

// Oversharpening one half does not make up for the other.
TEST(DetailKept, EachWindowHasItsLimit) {
  const Image photo = Leaves(4);
  Image half = Blur(photo, 2);
  const Image strong = UnsharpMask(photo, 1, 1);
  const double soft = Kept(half, photo);
  for (int y = 0; y < photo.height; ++y)
    for (int x = 0; x < photo.width / 2; ++x)
      for (int c = 0; c < 3; ++c) half.at(x, y)[c] = strong.at(x, y)[c];
  EXPECT_LT(Kept(half, photo), 0.65);
  EXPECT_GT(Kept(half, photo), soft + 0.3);
}

TEST(DetailKept, UndefinedWithoutAFineBand) {
  Image flat(64, 48, 3), noisy(64, 48, 3);
  for (float& p : flat.pixels) p = 0.5f;
  noisy = WithNoise(flat, 5, 1);
  const FineDetail detail = MeasureFineDetail(noisy, flat);
  EXPECT_FALSE(detail.kept);
  EXPECT_NEAR(*detail.levels, 3.4, 0.8);  // the band of 5 levels in each of three channels
  // Rounding to 8 bits is no detail.
  Image ramp = flat;
  for (int y = 0; y < ramp.height; ++y)
    for (int x = 0; x < ramp.width; ++x)
      for (int c = 0; c < 3; ++c)
        ramp.at(x, y)[c] = std::round(100 + 0.07f * static_cast<float>(x + 2 * y)) / 255.0f;
  EXPECT_FALSE(MeasureFineDetail(noisy, ramp).kept);
  EXPECT_EQ(*MeasureFineDetail(flat, Leaves(1, 64, 48)).kept, 0);  // a flat render keeps none
}

TEST(DetailKept, NonFiniteValuesAreLeftOutOfBoth) {
  const Image photo = Leaves(5), render = Blur(photo, 0.6);
  Image masked = photo, spoiled = render;
  for (int y = 30; y < 70; ++y)
    for (int x = 40; x < 100; ++x) {
      masked.at(x, y)[1] = kNan;
      spoiled.at(x, y)[2] = y % 2 ? kNan : std::numeric_limits<float>::infinity();
    }
  const FineDetail by_mask = MeasureFineDetail(render, masked);
  const FineDetail by_render = MeasureFineDetail(spoiled, photo);
  EXPECT_EQ(*by_mask.kept, *by_render.kept);
  EXPECT_EQ(*by_mask.levels, *by_render.levels);
  EXPECT_NEAR(Kept(masked, masked), 1, 1e-12);
  // The rest of the picture is as detailed as the whole.
  EXPECT_NEAR(*by_mask.kept, Kept(render, photo), 0.1);
  Image none = photo;
  for (float& p : none.pixels) p = kNan;
  EXPECT_FALSE(MeasureFineDetail(render, none).kept);
  EXPECT_FALSE(MeasureFineDetail(render, none).levels);
}

}  // namespace
}  // namespace regrade
