// The adjoint of a picture of splats, against differences in double, at its limits, and in
// float.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "kernels/splats/render_picture.h"
#include "tests/support/derivative.h"
#include "tests/support/record_error.h"
#include "tests/support/small_splats.h"

namespace regrade {
namespace {

using testing::CastSplats;
using testing::DerivativeBy;
using testing::Draw;
using testing::RandomSplats;
using testing::RoundedToFloat;
using testing::SplatCameraOf;

// A gradient by every number of a picture.
template <typename T>
SplatPicture<T> RandomAdjoint(const Camera& camera) {
  SplatPicture<T> d(camera.width, camera.height);
  uint64_t n = 0;
  for (std::vector<T>* values : {&d.color, &d.depth, &d.transmittance})
    for (T& value : *values) value = static_cast<float>(Draw(5, n++, 0, -1, 1));
  return d;
}

double Loss(const SplatArrays<double>& splats, const Camera& camera,
            const SplatOptions& options, const SplatPicture<double>& d) {
  const SplatPicture<double> picture = RenderSplatsPlain(splats.view(), camera, options);
  double sum = 0;
  for (size_t i = 0; i < d.color.size(); ++i) sum += d.color[i] * picture.color[i];
  for (size_t i = 0; i < d.depth.size(); ++i)
    sum += d.depth[i] * picture.depth[i] + d.transmittance[i] * picture.transmittance[i];
  return sum;
}

class SplatGradient : public ::testing::TestWithParam<std::tuple<int, bool, float>> {};

// Every value of random scenes, with splats in front of each other, at the edges and beyond the
// limits of the slope. Jumps at alpha = 1 / 255 and where a pixel ends, and kinks at 0.99 and
// at black, show as derivatives of two steps that disagree, and are left out.
TEST_P(SplatGradient, AdjointEqualsDerivativeInDouble) {
  const auto [basis, antialiased, dropout] = GetParam();
  const Camera camera = SplatCameraOf(13, 10);
  SplatOptions options{.fit_pixel = antialiased ? 0.0f : -1.0f};
  options.dropout = SplatDropout(dropout, 3, 4);
  const SplatPicture<double> d = RandomAdjoint<double>(camera);
  int checked = 0, not_zero = 0, all = 0, limited = 0;
  for (const auto& [seed, spread] : {std::pair{31u, 1.2}, {32u, 2.6}}) {
    SplatArrays<double> splats = RandomSplats(14, basis, seed, spread, 0.15);
    const SplatArrays<double> gradient =
        RenderSplatsPlainAdjoint(splats.view(), camera, options, d);
    for (const SeenSplat<double>& seen : SeeSplats(splats.view(), camera, options)) {
      SplatProjection<double> p;
      ASSERT_TRUE(
          ProjectMean(SplatCamera(camera), options, splats.view()[seen.index].mean, &p));
      limited += (p.limited[0] || p.limited[1]) &&
                 !ExtentOf(SplatCamera(camera), seen.ellipse, seen.reach).empty();
    }
    const auto check = [&](double* x, double by_adjoint) {
      ++all;
      const double numeric = DerivativeBy(
          x, [&] { return Loss(splats, camera, options, d); }, 2e-4, 2e-5);
      if (std::isnan(numeric)) return;
      ++checked;
      not_zero += by_adjoint != 0;
      // Losses are near 30, the third differences below 1e-9 of them.
      EXPECT_NEAR(numeric, by_adjoint,
                  testing::RecordDigits("gradient of a picture", testing::Computed::kDouble,
                                        numeric - by_adjoint, 2e-9, 1 + std::abs(by_adjoint)));
    };
    const auto check_all = [&](std::vector<double>* x, const std::vector<double>& by_adjoint) {
      for (size_t i = 0; i < x->size(); ++i) check(&(*x)[i], by_adjoint[i]);
    };
    check_all(&splats.mean, gradient.mean);
    check_all(&splats.log_scale, gradient.log_scale);
    check_all(&splats.quaternion, gradient.quaternion);
    check_all(&splats.opacity_logit, gradient.opacity_logit);
    check_all(&splats.sh, gradient.sh);
    for (int c = 0; c < 3; ++c) check(&splats.background[c], gradient.background[c]);
  }
  EXPECT_GT(checked, 0.8 * all);
  EXPECT_GT(not_zero, (dropout > 0 ? 0.4 : 0.7) * all);
  EXPECT_GT(limited, 0);
}

INSTANTIATE_TEST_SUITE_P(Degrees, SplatGradient,
                         ::testing::Combine(::testing::Values(1, 4, 9, 16), ::testing::Bool(),
                                            ::testing::Values(0.0f, 0.3f)));

// One splat in the middle of the picture.
SplatArrays<double> OneSplat(double logit, double scale) {
  SplatArrays<double> splats(1, 1);
  splats.Set(
      0, {{0, 0, 0}, {std::log(scale), std::log(scale), std::log(scale)}, {1, 0, 0, 0}, logit});
  splats.sh = {0.5, 0.2, -0.1};
  return splats;
}

TEST(SplatLimits, AboveTheGreatestAlphaOnlyTheColourHasAGradient) {
  const Camera camera = SplatCameraOf(3, 3);
  const SplatPicture<double> d = RandomAdjoint<double>(camera);
  // So wide and opaque that alpha is 0.99 in all pixels: o exp(-q / 2) is above 0.999.
  const SplatArrays<double> splats = OneSplat(9, 300);
  const SplatArrays<double> gradient =
      RenderSplatsPlainAdjoint(splats.view(), camera, SplatOptions(), d);
  EXPECT_EQ(gradient.opacity_logit[0], 0);
  for (const double g : gradient.log_scale) EXPECT_EQ(g, 0);
  for (const double g : gradient.quaternion) EXPECT_EQ(g, 0);
  for (const double g : gradient.sh) EXPECT_NE(g, 0);
  const SplatArrays<double> below = OneSplat(4, 300);
  EXPECT_NE(RenderSplatsPlainAdjoint(below.view(), camera, SplatOptions(), d).opacity_logit[0],
            0);
}

TEST(SplatDropout, LeavesOutItsShareAndRaisesTheOthersOpacities) {
  const Camera camera = SplatCameraOf(13, 10);
  const SplatArrays<double> splats = RandomSplats(4000, 1, 7, 1.0, 0.15);
  const SplatOptions all;
  const std::vector<SeenSplat<double>> seen = SeeSplats(splats.view(), camera, all);
  std::vector<double> log_opacity(4000, 1);
  for (const SeenSplat<double>& splat : seen)
    log_opacity[static_cast<size_t>(splat.index)] = splat.log_opacity;
  std::vector<int> times(4000);
  for (const uint64_t step : {1u, 2u}) {
    SplatOptions some;
    some.dropout = SplatDropout(0.25f, 3, step);
    for (const SeenSplat<double>& splat : SeeSplats(splats.view(), camera, some)) {
      const size_t i = static_cast<size_t>(splat.index);
      ++times[i];
      if (log_opacity[i] <= 0) {  // it is seen without the gain, too
        EXPECT_NEAR(splat.log_opacity - log_opacity[i], std::log(4.0 / 3), 1e-6);
      }
    }
  }
  int once = 0, twice = 0;
  for (const SeenSplat<double>& splat : seen) {
    once += times[static_cast<size_t>(splat.index)] == 1;
    twice += times[static_cast<size_t>(splat.index)] == 2;
  }
  // Of n independent draws, within five standard errors.
  const double n = static_cast<double>(seen.size());
  EXPECT_GT(n, 1000);
  EXPECT_NEAR(once / n, 2 * 0.25 * 0.75, 5 * std::sqrt(0.24 / n));
  EXPECT_NEAR(twice / n, 0.75 * 0.75, 5 * std::sqrt(0.25 / n));
}

TEST(SplatLimits, ABlackChannelHasNoGradient) {
  const Camera camera = SplatCameraOf(5, 5);
  const SplatPicture<double> d = RandomAdjoint<double>(camera);
  SplatArrays<double> splats = OneSplat(0, 0.5);
  splats.sh[1] = -0.5 / kSh0;  // 1/2 + sum is 0 or below
  splats.sh[2] = -7;
  const SplatArrays<double> gradient =
      RenderSplatsPlainAdjoint(splats.view(), camera, SplatOptions(), d);
  EXPECT_NE(gradient.sh[0], 0);
  EXPECT_EQ(gradient.sh[2], 0);
  const SplatPicture<double> picture = RenderSplatsPlain(splats.view(), camera, SplatOptions());
  for (const double value : picture.color) EXPECT_GE(value, 0);
}

TEST(SplatLimits, LogarithmsBeyondFiftyCountAsFifty) {
  const Camera camera = SplatCameraOf(5, 5);
  const SplatPicture<double> d = RandomAdjoint<double>(camera);
  SplatArrays<double> splats = OneSplat(0, 0.5), same = splats;
  splats.log_scale = {-80, -0.5, 1e30};
  same.log_scale = {-50, -0.5, 50};
  EXPECT_EQ(RenderSplatsPlain(splats.view(), camera, SplatOptions()).color,
            RenderSplatsPlain(same.view(), camera, SplatOptions()).color);
  const SplatArrays<double> gradient =
      RenderSplatsPlainAdjoint(splats.view(), camera, SplatOptions(), d);
  EXPECT_EQ(gradient.log_scale[0], 0);
  EXPECT_NE(gradient.log_scale[1], 0);
  EXPECT_EQ(gradient.log_scale[2], 0);
}

// The largest difference of two gradients over the largest entry, for each kind of value.
void ExpectDigits(const SplatArrays<float>& got, const SplatArrays<double>& exact,
                  double allowed, const std::string& scene) {
  const auto check = [&](const char* what, const std::vector<float>& a,
                         const std::vector<double>& b) {
    double largest = 0, error = 0;
    for (size_t i = 0; i < b.size(); ++i) {
      largest = std::max(largest, std::abs(b[i]));
      error = std::max(error, std::abs(a[i] - b[i]));
    }
    EXPECT_GT(largest, 0);
    EXPECT_LE(error, testing::RecordDigits(scene + ": gradient by " + what,
                                           testing::Computed::kFloat, error, allowed, largest))
        << what;
  };
  check("means", got.mean, exact.mean);
  check("scales", got.log_scale, exact.log_scale);
  check("quaternions", got.quaternion, exact.quaternion);
  check("opacities", got.opacity_logit, exact.opacity_logit);
  check("colours", got.sh, exact.sh);
}

TEST(SplatGradientInFloat, AgreesWithDouble) {
  const Camera camera = SplatCameraOf(40, 30);
  for (const bool antialiased : {false, true}) {
    SplatOptions options{.fit_pixel = antialiased ? 0.0f : -1.0f};
    const SplatArrays<double> splats = RoundedToFloat(RandomSplats(300, 16, 41));
    const SplatArrays<double> exact =
        RenderSplatsPlainAdjoint(splats.view(), camera, options, RandomAdjoint<double>(camera));
    const SplatArrays<float> got = RenderSplatsPlainAdjoint(
        CastSplats<float>(splats).view(), camera, options, RandomAdjoint<float>(camera));
    // Some ten roundings of 6e-8 a pixel, and sums of mixed signs.
    ExpectDigits(got, exact, 3e-6, "random splats");
  }
}

// Axes of 1e-3 and 1e3 world units, in any direction: on the screen a needle is a millionth as
// wide as long, and the blur alone keeps its ellipse regular.
TEST(SplatGradientInFloat, NeedlesKeepTheirDigits) {
  const Camera camera = SplatCameraOf(40, 30);
  for (const bool antialiased : {false, true}) {
    SplatOptions options{.fit_pixel = antialiased ? 0.0f : -1.0f};
    SplatArrays<double> splats = RandomSplats(60, 4, 43);
    for (size_t i = 0; i < 60; ++i) {
      splats.opacity_logit[i] = 3;
      for (size_t a = 0; a < 3; ++a)
        splats.log_scale[3 * i + a] = std::log(a == i % 3 ? 1e3 : antialiased ? 1e-1 : 1e-3);
    }
    splats = RoundedToFloat(splats);
    const SplatArrays<double> exact =
        RenderSplatsPlainAdjoint(splats.view(), camera, options, RandomAdjoint<double>(camera));
    const SplatArrays<float> got = RenderSplatsPlainAdjoint(
        CastSplats<float>(splats).view(), camera, options, RandomAdjoint<float>(camera));
    // A direction is rounded to 6e-8, which moves a needle of 300 pixels a unit by 2e-5.
    ExpectDigits(got, exact, 1e-4, "needles");
  }
}

}  // namespace
}  // namespace regrade
