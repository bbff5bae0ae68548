// Pictures of splats: compositing, order, depths, the filter, and what is left out.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "kernels/splats/compositing.h"
#include "kernels/splats/render_picture.h"
#include "tests/support/expect_error.h"
#include "tests/support/floating_point_traps.h"
#include "tests/support/pinhole.h"
#include "tests/support/record_error.h"
#include "tests/support/small_splats.h"
#include "tests/support/threads.h"

namespace regrade {
namespace {

using testing::CastSplats;
using testing::Draw;
using testing::RandomSplats;
using testing::RoundedToFloat;
using testing::SplatCameraOf;

// Looks along z from the origin, 100 pixels a unit of slope, the axis through a pixel's centre.
Camera StraightCamera(int size) {
  Camera camera = testing::PinholeOf(size, size, 100, size / 2 + 0.5, size / 2 + 0.5);
  return camera;
}

// A ball of `scale` on the axis of StraightCamera, grey of `value`.
void SetBall(SplatArrays<double>* splats, int64_t i, double z, double scale, double logit,
             double value) {
  const double l = std::log(scale);
  splats->Set(i, {{0, 0, z}, {l, l, l}, {1, 0, 0, 0}, logit});
  for (int k = 0; k < 3 * splats->basis; ++k)
    splats->sh[static_cast<size_t>(3 * splats->basis * i + k)] =
        k % splats->basis == 0 ? (value - 0.5) / kSh0 : 0;
}

TEST(SplatRender, WeightsSumToThePicture) {
  const Camera camera = SplatCameraOf(24, 18);
  const SplatOptions options;
  const SplatArrays<float> splats = CastSplats<float>(RandomSplats(300, 9, 81));
  const SplatPicture<float> picture = RenderSplatsPlain(splats.view(), camera, options);
  const std::vector<SeenSplat<float>> seen = SeeSplats(splats.view(), camera, options);
  std::vector<const SeenSplat<float>*> by_index(static_cast<size_t>(splats.count()));
  for (const SeenSplat<float>& splat : seen)
    by_index[static_cast<size_t>(splat.index)] = &splat;
  size_t most = 0;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const auto weights = WeightsOfPixel(seen, x, y);
      most = std::max(most, weights.size());
      const size_t at = static_cast<size_t>(y) * camera.width + x;
      double sum = 0, depth = 0;
      Vec3d color = (splats.background * picture.transmittance[at]).Cast<double>();
      float before = 0;
      for (const auto& [index, weight] : weights) {
        const SeenSplat<float>& splat = *by_index[static_cast<size_t>(index)];
        sum += weight;
        depth += double{weight} * splat.z;
        color += splat.color.Cast<double>() * weight;
        EXPECT_GE(splat.z, before);
        before = splat.z;
      }
      // A rounding for each splat.
      const auto near = [&](const char* what, double off) {
        ASSERT_NEAR(off, 0, testing::RecordDigits(what, testing::Computed::kFloat, off, 1e-6));
      };
      near("weights and transmittance, of 1", sum + picture.transmittance[at] - 1);
      near("depth", (depth - picture.depth[at]) / 4);
      for (int c = 0; c < 3; ++c) near("colour", color[c] - picture.color[3 * at + c]);
      EXPECT_GE(picture.transmittance[at], 1e-4f);
    }
  EXPECT_GT(most, 10u);
}

// Splats of one depth are ordered by index: a permutation of the input changes the picture only
// as it changes the order, and equal input gives equal bits with any number of threads.
TEST(SplatRender, AThousandSplatsAtOneDepthAreOrderedByIndex) {
  const Camera camera = SplatCameraOf(16, 12);
  SplatArrays<double> splats = RandomSplats(1000, 1, 82, 0.8, 0.1);
  const RigidTransform world_from_camera = camera.camera_from_world.Inverse();
  for (int64_t i = 0; i < 1000; ++i) {
    Splat<double> splat = splats.view()[i];
    // 3 - 1e-9 and 3 + 1e-9 are one float.
    splat.mean = world_from_camera *
                 Vec3d{splat.mean.x, splat.mean.y, 3 + 1e-9 * static_cast<double>(i % 3 - 1)};
    splats.Set(i, splat);
  }
  const auto seen = SeeSplats(splats.view(), camera, SplatOptions());
  ASSERT_GT(seen.size(), 800u);
  for (size_t i = 1; i < seen.size(); ++i) ASSERT_LT(seen[i - 1].index, seen[i].index);
  const SplatPicture<double> first = RenderSplatsPlain(splats.view(), camera, SplatOptions());
  SplatPicture<double> d(camera.width, camera.height);
  std::fill(d.color.begin(), d.color.end(), 1.0);
  const auto gradient = RenderSplatsPlainAdjoint(splats.view(), camera, SplatOptions(), d);
  for (const int threads : {1, 3}) {
    const testing::Threads use(threads);
    const auto again = RenderSplatsPlain(splats.view(), camera, SplatOptions());
    EXPECT_TRUE(
        testing::RecordSameBits("the same picture", testing::Computed::kDouble,
                                again.color == first.color && again.depth == first.depth));
    EXPECT_TRUE(testing::RecordSameBits(
        "the same gradient", testing::Computed::kDouble,
        RenderSplatsPlainAdjoint(splats.view(), camera, SplatOptions(), d).mean ==
            gradient.mean));
  }
}

// With distinct depths the order of the input does not matter.
TEST(SplatRender, APermutationOfDistinctDepthsIsTheSamePicture) {
  const Camera camera = SplatCameraOf(16, 12);
  const SplatArrays<double> splats = RandomSplats(200, 4, 83);
  SplatArrays<double> reversed(200, 4);
  for (int64_t i = 0; i < 200; ++i) {
    reversed.Set(199 - i, splats.view()[i]);
    std::copy_n(splats.sh.begin() + 12 * i, 12, reversed.sh.begin() + 12 * (199 - i));
  }
  reversed.background = splats.background;
  EXPECT_EQ(RenderSplatsPlain(splats.view(), camera, SplatOptions()).color,
            RenderSplatsPlain(reversed.view(), camera, SplatOptions()).color);
}

// The splat that would leave less than 1e-4, and all behind it, are left out; what lets more
// than 254 / 255 through is, too.
TEST(SplatRender, APixelEndsBeforeTheSplatThatWouldTakeItBelowTheLeastTransmittance) {
  const Camera camera = StraightCamera(3);
  SplatArrays<double> splats(5, 1);
  SetBall(&splats, 0, 1, 1, -5.6, 1);  // o = 1 / 271
  SetBall(&splats, 1, 2, 1e6, 20, 0.2);
  SetBall(&splats, 2, 3, 1e6, 2, 0.4);   // alpha = 0.88: T = 0.01 * 0.12
  SetBall(&splats, 3, 4, 1e6, 20, 0.6);  // would leave 1.2e-5
  SetBall(&splats, 4, 5, 1e6, 0, 0.8);   // would leave 6e-4, but is behind
  splats.background = {1, 1, 1};
  const auto weights = WeightsOfPixel(SeeSplats(splats.view(), camera, SplatOptions()), 1, 1);
  ASSERT_EQ(weights.size(), 2u);
  EXPECT_EQ(weights[0].index, 1);
  EXPECT_DOUBLE_EQ(weights[0].weight, 0.99);
  const double alpha = 1 / (1 + std::exp(-2.0));
  EXPECT_EQ(weights[1].index, 2);
  EXPECT_NEAR(weights[1].weight, 0.01 * alpha, 1e-12);
  const auto picture = RenderSplatsPlain(splats.view(), camera, SplatOptions());
  const double t = 0.01 * (1 - alpha);
  EXPECT_NEAR(picture.transmittance[4], t, 1e-12);
  EXPECT_NEAR(picture.color[12], 0.99 * 0.2 + 0.01 * alpha * 0.4 + t, 1e-12);
  EXPECT_NEAR(picture.depth[4], 0.99 * 2 + 0.01 * alpha * 3, 1e-11);
  EXPECT_EQ(picture.median_depth[4], 2);
}

TEST(SplatRender, MedianDepthIsWhereHalfOfTheLightIsGone) {
  const Camera camera = StraightCamera(3);
  SplatArrays<double> splats(4, 1);
  for (int64_t i = 0; i < 4; ++i)  // alpha = 0.2: T = 0.8, 0.64, 0.512, 0.41
    SetBall(&splats, i, 2 + static_cast<double>(i), 1e6, std::log(0.25), 0.5);
  EXPECT_EQ(RenderSplatsPlain(splats.view(), camera, SplatOptions()).median_depth[4], 5);
  splats.opacity_logit[3] = -10;
  EXPECT_EQ(RenderSplatsPlain(splats.view(), camera, SplatOptions()).median_depth[4], 0);
}

// With the filter, the sum of alpha over pixels is what the unblurred Gaussian covers, o 2 pi
// sigma^2, however small it is; without, it is at least the blur's.
TEST(SplatRender, TheFilterKeepsASmallSplatsLight) {
  const Camera camera = StraightCamera(31);
  SplatOptions options;
  for (const double sigma : {0.4, 0.6, 1.0, 2.0}) {  // pixels
    SplatArrays<double> splats(1, 1);
    SetBall(&splats, 0, 1, sigma / 100, 6, 1);
    const auto sum = [&](bool antialiased) {
      options.fit_pixel = antialiased ? 0 : -1;
      double total = 0;
      for (const double t : RenderSplatsPlain(splats.view(), camera, options).transmittance)
        total += 1 - t;
      return total;
    };
    // What is below 1 / 255 is missing: at most 1 / (255 o rho), and 0.01 at the peak.
    const double rho = sigma * sigma / (sigma * sigma + 0.3), exact = 2 * M_PI * sigma * sigma;
    const double missing = 1 / (255 * rho) + 0.006;
    EXPECT_NEAR(sum(true) / exact, 1 - missing / 2, missing / 2 + 0.003) << sigma;
    EXPECT_NEAR(sum(false) / (exact + 2 * M_PI * 0.3), 1, 0.02) << sigma;
  }
}

// Three times the pixels for an angle: every third pixel is the fit's.
TEST(SplatRender, ALargerPictureIsTheFitsPictureEnlarged) {
  const Camera small = SplatCameraOf(24, 18);
  Camera large = small;
  large.width *= 3, large.height *= 3;
  large.fx *= 3, large.fy *= 3, large.cx *= 3, large.cy *= 3;
  SplatOptions options{.fit_pixel = 1 / std::sqrt(small.fx * small.fy)};
  const SplatArrays<double> splats = RandomSplats(60, 4, 83);
  const auto fit = RenderSplatsPlain(splats.view(), small, options);
  const auto enlarged = RenderSplatsPlain(splats.view(), large, options);
  for (size_t y = 0; y < 18; ++y)
    for (size_t x = 0; x < 24; ++x)
      for (size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(enlarged.color[3 * (72 * (3 * y + 1) + 3 * x + 1) + c],
                    fit.color[3 * (24 * y + x) + c], 1e-12);
}

// Whatever the size, a splat covers the solid angle that the fit saw, its blur included.
TEST(SplatRender, ASmallerPictureKeepsTheFitsLight) {
  const Camera camera = StraightCamera(31);
  SplatOptions options;
  for (const double r : {0.3, 0.5, 0.8}) {
    options.fit_pixel = r / 100;
    for (const double sigma : {0.1, 0.5, 2.0}) {  // pixels of this picture
      SplatArrays<double> splats(1, 1);
      SetBall(&splats, 0, 1, sigma / 100, 6, 1);
      double total = 0;
      for (const double t : RenderSplatsPlain(splats.view(), camera, options).transmittance)
        total += 1 - t;
      const double fitted = sigma * sigma + 0.3 * r * r, rho = fitted / (sigma * sigma + 0.3);
      const double exact = 2 * M_PI * fitted, missing = 1 / (255 * rho) + 0.006;
      EXPECT_NEAR(total / exact, 1 - missing / 2, missing / 2 + 0.003) << r << " " << sigma;
    }
  }
}

// Ten thousand splats around one ray, in float and double.
TEST(SplatRender, FloatAgreesWithDoubleOverTenThousandSplatsOnOneRay) {
  const Camera camera = StraightCamera(5);
  for (const bool antialiased : {false, true}) {
    SplatOptions options{.fit_pixel = antialiased ? 0.0f : -1.0f};
    SplatArrays<double> splats = RandomSplats(10000, 4, 84, 0.2, 2);
    for (size_t i = 0; i < 10000; ++i) {
      splats.mean[3 * i + 2] = Draw(85, i, 0, 1, 50);
      splats.opacity_logit[i] = Draw(85, i, 1, -5.6, -5.4);  // 1 / 271 to 1 / 222
    }
    splats = RoundedToFloat(splats);
    const auto exact = RenderSplatsPlain(splats.view(), camera, options);
    const auto got = RenderSplatsPlain(CastSplats<float>(splats).view(), camera, options);
    const size_t hits = WeightsOfPixel(SeeSplats(splats.view(), camera, options), 2, 2).size();
    EXPECT_GT(hits, 700u);
    for (size_t p = 0; p < exact.depth.size(); ++p) {
      // A rounding of T for each of some thousand splats.
      const double off = got.transmittance[p] - exact.transmittance[p];
      ASSERT_NEAR(
          off, 0,
          testing::RecordDigits("transmittance over thousands of splats",
                                testing::Computed::kFloat, off, 1e-4, exact.transmittance[p]));
      for (size_t c = 3 * p; c < 3 * p + 3; ++c)
        ASSERT_NEAR(
            got.color[c], exact.color[c],
            testing::RecordDigits("colour over thousands of splats", testing::Computed::kFloat,
                                  got.color[c] - exact.color[c], 5e-6));
      ASSERT_NEAR(
          got.depth[p], exact.depth[p],
          testing::RecordDigits("depth over thousands of splats", testing::Computed::kFloat,
                                got.depth[p] - exact.depth[p], 2e-6, 50));
    }
  }
}

// Where q is a rounding away from Q, or T from 1e-4, float and double may decide differently:
// a pixel then lacks a splat of alpha 1 / 255, or what is behind a T of 1e-4.
TEST(SplatRender, FloatAgreesWithDoubleInRandomScenes) {
  const Camera camera = SplatCameraOf(60, 40);
  int decided_otherwise = 0;
  for (const bool antialiased : {false, true})
    for (const double spread : {0.8, 3.0}) {  // the second is around the camera, too
      SplatOptions options{.fit_pixel = antialiased ? 0.0f : -1.0f};
      const SplatArrays<double> splats = RoundedToFloat(RandomSplats(800, 16, 86, spread));
      const auto exact = RenderSplatsPlain(splats.view(), camera, options);
      const auto got = RenderSplatsPlain(CastSplats<float>(splats).view(), camera, options);
      for (size_t p = 0; p < exact.depth.size(); ++p) {
        double off = 0;
        for (size_t c = 3 * p; c < 3 * p + 3; ++c)
          off = std::max(off, std::abs(got.color[c] - exact.color[c]));
        if (off > 1e-5) {
          ++decided_otherwise;
          EXPECT_LE(off, 2 / 255.0);  // colours are at most 2
        } else {
          testing::RecordDigits("colour of a pixel", testing::Computed::kFloat, off, 1e-5);
        }
      }
    }
  EXPECT_LE(decided_otherwise, 9600 / 1000);
}

// A splat with one value that is not finite or too large is not in any picture, and has no
// gradient; a file with it is refused, with its number.
TEST(SplatRender, SplatsWithoutFiniteValuesAreLeftOut) {
  const testing::MayBeNotFinite compared;
  const Camera camera = SplatCameraOf(12, 9);
  const Splats splats = CastSplats<float>(RandomSplats(20, 4, 87));
  Splats without = splats;
  without.opacity_logit[7] = -100;
  const auto expected = RenderSplatsPlain(without.view(), camera, SplatOptions());
  ASSERT_NE(RenderSplatsPlain(splats.view(), camera, SplatOptions()).color, expected.color);
  Validate(splats, "good.ply");
  SplatPicture<float> d(camera.width, camera.height);
  std::fill(d.color.begin(), d.color.end(), 1.0f);
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
        -std::numeric_limits<float>::infinity()})
    for (int kind = 0; kind < 5; ++kind) {
      Splats damaged = splats;
      std::vector<float>* const values[] = {&damaged.mean, &damaged.log_scale,
                                            &damaged.quaternion, &damaged.opacity_logit,
                                            &damaged.sh};
      const size_t per_splat = values[kind]->size() / 20;
      (*values[kind])[7 * per_splat + per_splat / 2] = bad;
      const auto picture = RenderSplatsPlain(damaged.view(), camera, SplatOptions());
      EXPECT_EQ(picture.color, expected.color) << kind;
      const auto gradient = RenderSplatsPlainAdjoint(damaged.view(), camera, SplatOptions(), d);
      EXPECT_EQ(gradient.opacity_logit[7], 0);
      EXPECT_EQ(gradient.sh[7 * 12], 0);
      EXPECT_REGRADE_ERROR(Validate(damaged, "bad.ply"), ExitCode::kInput, "the first is 7");
    }
  Splats large = splats;
  large.sh[7 * 12] = 2e6f;
  EXPECT_REGRADE_ERROR(Validate(large, "bad.ply"), ExitCode::kInput, "1 splats of 20");
  EXPECT_EQ(RenderSplatsPlain(large.view(), camera, SplatOptions()).color, expected.color);
}

TEST(SplatRender, ArraysThatDisagreeAreRefused) {
  const Splats splats = CastSplats<float>(RandomSplats(5, 4, 88));
  Splats damaged = splats;
  damaged.basis = 9;
  EXPECT_REGRADE_ERROR(Validate(damaged, "a"), ExitCode::kInput, "sizes");
  damaged.basis = 5;
  EXPECT_REGRADE_ERROR(Validate(damaged, "a"), ExitCode::kInput, "5 harmonics");
  damaged = splats;
  damaged.mean.pop_back();
  EXPECT_REGRADE_ERROR(Validate(damaged, "a"), ExitCode::kInput, "sizes");
  damaged = splats;
  damaged.background.y = std::numeric_limits<float>::infinity();
  EXPECT_REGRADE_ERROR(Validate(damaged, "a"), ExitCode::kInput, "background");
}

// A splat around the camera, larger than the scene: its mean before the camera, it covers all
// pixels alike; its mean behind, it is left out.
TEST(SplatRender, ASplatAroundTheCameraCoversThePicture) {
  const Camera camera = StraightCamera(5);
  SplatArrays<double> splats(1, 1);
  for (const double log_scale : {3.0, 20.0, 50.0}) {
    SetBall(&splats, 0, 0.3, 1, 3, 0.8);
    splats.log_scale = {log_scale, log_scale, log_scale};
    const auto picture =
        RenderSplatsPlain(CastSplats<float>(splats).view(), camera, SplatOptions());
    const double t = 1 / (1 + std::exp(3.0));
    for (const float value : picture.transmittance) EXPECT_NEAR(value, t, 1e-5);
  }
  splats.mean[2] = -0.3;
  for (const double value :
       RenderSplatsPlain(splats.view(), camera, SplatOptions()).transmittance)
    EXPECT_EQ(value, 1);
}

// No splats: the background.
TEST(SplatRender, WithoutSplatsThereIsTheBackground) {
  SplatArrays<double> splats(0, 1);
  splats.background = {0.25, 0.5, 0.75};
  const auto picture = RenderSplatsPlain(splats.view(), StraightCamera(2), SplatOptions());
  EXPECT_EQ(picture.color[0], 0.25);
  EXPECT_EQ(picture.color[11], 0.75);
  EXPECT_EQ(picture.transmittance[3], 1);
}

}  // namespace
}  // namespace regrade
