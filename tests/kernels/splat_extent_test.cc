// A splat's opacity, and the part of the screen where it is seen.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/splats/compositing.h"
#include "kernels/splats/extent.h"
#include "kernels/splats/seen_splat.h"
#include "tests/support/record_error.h"
#include "tests/support/small_splats.h"

namespace regrade {
namespace {

using testing::CastSplats;
using testing::RandomSplats;
using testing::SplatCameraOf;

// No pixel outside the extent sees the splat, in float, and the ellipse touches all four sides:
// at d = S e m the side is reached with q = Q.
TEST(SplatExtent, NoPixelOutsideSeesTheSplatAndTheSidesAreReached) {
  const Camera camera = SplatCameraOf(60, 40);
  const SplatCamera own(camera);
  for (const bool antialiased : {false, true}) {
    SplatOptions options{.fit_pixel = antialiased ? 0.0f : -1.0f};
    SplatArrays<double> splats = RandomSplats(300, 1, 67, 1.8, 0.01);
    for (size_t i = 0; i < 100; ++i) splats.log_scale[3 * i] += 3;  // some are long
    const SplatArrays<float> values = CastSplats<float>(splats);
    int boxes = 0, hits = 0, touched = 0;
    for (int64_t i = 0; i < values.count(); ++i) {
      SeenSplat<float> seen;
      if (!SeeSplat(own, options, values.view(), i, &seen)) continue;
      const PixelBox box = ExtentOf(own, seen.ellipse, seen.reach);
      boxes += !box.empty();
      PixelBox found{camera.width, camera.height, 0, 0};
      for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
          SplatHit<float> hit;
          if (!HitSplat(seen.ellipse, seen.log_opacity, seen.reach, x, y, &hit)) continue;
          ++hits;
          ASSERT_TRUE(x >= box.x0 && x < box.x1 && y >= box.y0 && y < box.y1);
          EXPECT_GE(hit.alpha, (1 - 1e-5) / 255);
          found = {std::min(found.x0, x), std::min(found.y0, y), std::max(found.x1, x + 1),
                   std::max(found.y1, y + 1)};
        }
      touched += found.x0 == box.x0 && found.x1 == box.x1;
      SplatProjection<double> p;
      ASSERT_TRUE(ProjectSplat(own, options, CastSplats<double>(values).view()[i], &p));
      double log_opacity, reach;
      if (!SplatReach<double>(values.opacity_logit[i], p.ellipse.filter, &log_opacity, &reach))
        continue;
      const double c00 = p.ellipse.c00, c10 = p.ellipse.c10, c11 = p.ellipse.c11;
      const double yy = c10 * c10 + c11 * c11, r = std::sqrt(reach);
      const double sides[2][2] = {{r * c00, r * c10},
                                  {r * c00 * c10 / std::sqrt(yy), r * std::sqrt(yy)}};
      for (const auto& d : sides) {
        double w[2];
        p.ellipse.Whiten(d[0], d[1], w);
        const double off = (w[0] * w[0] + w[1] * w[1] - reach) / (1e-3 + reach);
        EXPECT_NEAR(
            off, 0,
            testing::RecordDigits("q at a side", testing::Computed::kDouble, off, 1e-12));
        // And alpha is 1 / 255 there.
        EXPECT_NEAR(255 * std::exp(log_opacity - (w[0] * w[0] + w[1] * w[1]) / 2), 1, 1e-11);
      }
    }
    EXPECT_GT(boxes, 120);
    EXPECT_GT(hits, 2000);
    EXPECT_GT(touched, boxes / 3);  // a side between two columns' centres touches neither
  }
}

// o and 1 - o keep their digits at both ends.
TEST(SplatOpacity, LogarithmKeepsItsDigitsAtBothEnds) {
  for (const float x :
       {-1e4f, -80.0f, -20.0f, -1.0f, -1e-3f, 0.0f, 1e-3f, 1.0f, 20.0f, 80.0f}) {
    const long double e = expl(-std::abs(static_cast<long double>(x)));
    const double exact = static_cast<double>((x < 0 ? x : 0.0L) - log1pl(e));
    const double slope = static_cast<double>((x < 0 ? 1 : e) / (1 + e));
    const double off = LogSigmoid(double{x}) - exact, off_float = LogSigmoid(x) - exact;
    EXPECT_NEAR(off, 0,
                testing::RecordDigits("ln of an opacity", testing::Computed::kDouble, off,
                                      3e-16, std::abs(exact)));
    EXPECT_NEAR(off_float, 0,
                testing::RecordDigits("ln of an opacity in float", testing::Computed::kFloat,
                                      off_float, 2e-7, std::abs(exact)));
    const double off_slope = LogSigmoidDerivative(x) - slope;
    EXPECT_NEAR(off_slope, 0,
                testing::RecordDigits("its derivative in float", testing::Computed::kFloat,
                                      off_slope, 2e-7, slope));
  }
  float log_opacity, reach;
  for (const float x : {-3e38f, -200.0f, -5.6f})
    EXPECT_FALSE(SplatReach(x, 1.0f, &log_opacity, &reach));
  for (const float x : {-5.5f, 0.0f, 200.0f, 3e38f})
    EXPECT_TRUE(SplatReach(x, 1.0f, &log_opacity, &reach));
  EXPECT_FALSE(SplatReach(3e38f, 0.0f, &log_opacity, &reach));
}

}  // namespace
}  // namespace regrade
